"""A channel that does not fit the others, and the sentence about it: what was seen, what was expected, where to look."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

__all__ = ["Misfit", "Seen", "misfit_sentence"]

ALIKE = 1.5  # ratios within this factor, up or down, count as equal: the channels share one cause


class Seen(Enum):
    """Source of an expectation."""

    SHAPES = "by the mode shapes"
    BEFORE = "by the points before"
    NOT_TRUSTED = "where it did not fit"
    OTHER_WAY = "by the other way past the level"


class Misfit(NamedTuple):
    """Comparison of one channel with its expected value."""

    channel: str
    """Name of the channel."""
    seen: float
    """Amplitude over that of the drive channel; negative if the channel moves opposite to the expected direction."""
    expected: float
    """Expected ratio, above 0."""
    factor: float
    """Factor between the seen and the expected ratio beyond the allowance, 1 or more."""
    by: Seen
    """Source of the expected ratio."""
    at: str = ""
    """Level of the single point used for the comparison; empty if several points were used."""

    @property
    def times(self) -> float:
        """Ratio seen over ratio expected."""
        return self.seen / self.expected


def misfit_sentence(misfits: Sequence[Misfit], drive: str, warned: float, refused: float) -> str:
    """Describe the worst misfit in one sentence. If all channels are off by the same factor, name channel ``drive`` instead."""
    worst = max(misfits, key=lambda misfit: misfit.factor)
    bound = f"refused from a factor {refused:g}" if worst.factor >= refused else f"trusted up to a factor {warned:g}"
    off = [misfit for misfit in misfits if misfit.by is worst.by and misfit.factor >= warned]
    if len({misfit.channel for misfit in off}) > 1 and len(off) == sum(m.by is worst.by for m in misfits):
        times = [misfit.times for misfit in off]
        if min(times) > 0.0 and max(times) < ALIKE**2 * min(times):
            names = ", ".join(misfit.channel for misfit in off)
            return (
                f"channel {drive}: all others ({names}) are {worst.times:.3g} times as large against it as expected "
                f"{worst.by.value}, {bound}: look at its sensor, cable and sensitivity_v_per_unit"
            )
    return f"{_what_was_seen(worst)} {worst.by.value}, {bound}: {_where_to_look(worst)}"


def _what_was_seen(misfit: Misfit) -> str:
    if misfit.by is Seen.NOT_TRUSTED:
        return f"channel {misfit.channel}: force over velocity at the drive point is like that at {misfit.at},"
    if misfit.at:
        return (
            f"channel {misfit.channel}: force over velocity at the drive point is {misfit.times:.3g} times that at "
            f"{misfit.at}, expected about 1"
        )
    turned = " and moves the other way" if misfit.seen < 0.0 else ""
    return (
        f"channel {misfit.channel} has {abs(misfit.seen):.3g} times the size of the drive channel{turned}, "
        f"expected {misfit.expected:.3g}"
    )


def _where_to_look(misfit: Misfit) -> str:
    polarity = ", polarity" if misfit.seen < 0.0 else ""
    other = " and of the drive channel" if misfit.at else ""
    return f"look at sensor, cable{polarity} and sensitivity_v_per_unit of {misfit.channel}{other}"
