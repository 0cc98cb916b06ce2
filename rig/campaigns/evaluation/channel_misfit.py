"""A channel that does not fit the others, and the sentence about it: what was seen, what was expected, where to look."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

__all__ = ["Misfit", "Seen", "misfit_sentence"]

ALIKE = 1.5  # channels that are off by the same factor, to this, share one cause


class Seen(Enum):
    """What an expectation is derived from."""

    SHAPES = "by the mode shapes of the bench"
    BEFORE = "by the points before"
    NOT_TRUSTED = "where it did not fit"
    OTHER_WAY = "by the other way past the level"


class Misfit(NamedTuple):
    """One channel against what is expected of it."""

    channel: str
    """Its name."""
    seen: float
    """Its size over that of the drive channel; below 0 where it moves the other way than expected."""
    expected: float
    """What was expected, above 0."""
    factor: float
    """Factor by which the two differ beyond the allowance, 1 or more."""
    by: Seen
    """What the expectation comes from."""
    at: str = ""
    """Level of the one point that it is compared with; empty where there are several."""

    @property
    def times(self) -> float:
        """Seen over expected."""
        return self.seen / self.expected


def misfit_sentence(misfits: Sequence[Misfit], drive: str, warned: float, refused: float) -> str:
    """One sentence about the worst misfit. If all channels are off by the same factor, it names the channel ``drive``."""
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
