"""Segments that are evaluated together: decide when a round of them is over, and describe each for its evaluation."""

from collections.abc import Set
from typing import NamedTuple

from rig.tick.safety.layout import GuardMode
from rig.tick.sequencer.layout import Outcome, SegmentKind
from rig.tick.tick import Tick


class Passage(NamedTuple):
    """One segment of a round, located in the rows of the points that are measured together."""

    kind: SegmentKind
    """Kind of the segment: how it changed the level."""
    level: float
    """Final level of the segment, planned or reached."""
    first: int
    """Index of the first row of the segment."""
    end: int
    """Index of the row after the last row of the segment."""
    outcome: Outcome
    """How the segment ended; ``RUNNING`` if the control loop ended first."""


class Round(NamedTuple):
    """All segments of points that are measured together."""

    end_segment: int
    """Number of the segment after the last one of the round."""
    first_sample: int
    """Sample number of the first row of the round."""
    passages: tuple[Passage, ...]
    """Segments of the round, except those that were skipped."""
    ended_early: bool
    """Whether the output was brought down before the plan was completed."""


def round_at(tick: Tick, segment: int, numbers: Set[int], *, cut_short: bool) -> Round | None:
    """Return the round of the points ``numbers`` that begins with ``segment``; None if it has not begun or is not over.

    A round is over when all its segments are over or when the output is brought down. With ``cut_short``, a round that has
    begun is returned as far as it was measured.
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
