"""Segments that are evaluated together, as whoever evaluates them sees them."""

from typing import NamedTuple

from rig.sequencer.layout import Outcome, SegmentKind

__all__ = ["Passage"]


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
