"""Segments that are evaluated together: when they are over, and which rows they have."""

from collections.abc import Set
from typing import NamedTuple

from rig.tick.safety.layout import GuardMode
from rig.tick.sequencer.layout import Outcome, SegmentKind
from rig.tick.tick import Tick

__all__ = ["Passage", "Round", "round_at"]


class Passage(NamedTuple):
    """One segment among the rows of several points that are measured in one go."""

    kind: SegmentKind
    """What it did with the level."""
    level: float
    """Level that it ended with, or was to end with."""
    first: int
    """Number of its first row."""
    end: int
    """Number of the row behind its last."""
    outcome: Outcome
    """How it ended; ``RUNNING`` where the loop did."""


class Round(NamedTuple):
    """All segments of points that are measured in one go."""

    end_segment: int
    """Number of the segment behind its last."""
    first_sample: int
    """Sample of its first row."""
    passages: tuple[Passage, ...]
    """Its segments, but for those that were passed over."""
    ended_early: bool
    """Whether the output was brought down before the plan was carried out."""


def round_at(tick: Tick, segment: int, numbers: Set[int], *, cut_short: bool) -> Round | None:
    """The round of the points ``numbers`` that begins with a segment; None where it has not begun or is not over.

    It is over when all its segments are, when the output is brought down, or, ``cut_short``, whatever there is of it.
    """
    outcomes, segments = tick.outcomes, tick.arrays.segments
    end = segment
    while end < segments.size and int(segments[end]["point"]) in numbers:
        end += 1
    codes = [Outcome(int(outcome)) for outcome in outcomes["outcome"][segment:end]]
    if codes[0] is Outcome.PENDING:
        return None
    brought_down = int(tick.guard["mode"][0]) != GuardMode.ARMED
    if not cut_short and (Outcome.RUNNING in codes or (Outcome.PENDING in codes and not brought_down)):
        return None
    first = int(outcomes[segment]["first_sample"])
    passages = []
    for code, one, entry in zip(codes, segments[segment:end], outcomes[segment:end], strict=True):
        if code not in (Outcome.PENDING, Outcome.SKIPPED):
            stop = tick.sample if code is Outcome.RUNNING else int(entry["end_sample"])
            kind, level = SegmentKind(int(one["kind"])), float(one["level"])
            passages.append(Passage(kind, level, int(entry["first_sample"]) - first, stop - first, code))
    return Round(end, first, tuple(passages), brought_down or cut_short)
