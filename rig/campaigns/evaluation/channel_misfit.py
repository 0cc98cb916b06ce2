"""A channel that does not fit the others, and the sentence about it: what was seen, what was expected, where to look."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

WARNED = 2.0  # a nonlinear mode's shape changes by some per cent
CHANGED = 1.5  # the same against what was measured before in the same run
REFUSED = 4.0  # factor: a sensitivity that is wrong by 12 dB; chosen
WARNED_DEG = 5.0  # shipped rigs stay below 0.4 degrees, with friction as well
REFUSED_DEG = 45.0  # chosen: beyond it the held phase is no resonance any more
ALIKE = 1.5  # ratios within this factor, up or down, count as equal: the channels share one cause
ALIKE_DEG = 15.0  # the same for turns: within this of their mean


class Reference(Enum):
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
    by: Reference
    """Source of the expected ratio."""
    at: str = ""
    """Level of the single point used for the comparison; empty if several points were used."""
    turn_deg: float | None = None
    """Phase of the seen over the expected ratio, deg, if the misfit is one of phase; ``factor`` is then its equivalent."""
    swapped_with: str = ""
    """Name of the channel with which this one seems to be swapped."""

    @property
    def trusted(self) -> float:
        """Factor from which the point is warned of."""
        return WARNED if self.by is Reference.SHAPES or self.turn_deg is not None else CHANGED

    @property
    def warned(self) -> bool:
        """Whether the point is warned of, or refused."""
        return self.factor >= self.trusted

    @property
    def refused(self) -> bool:
        """Whether the point is refused."""
        return self.factor >= REFUSED

    @property
    def times(self) -> float:
        """Ratio seen over ratio expected."""
        return self.seen / self.expected


def misfit_sentence(misfits: Sequence[Misfit], drive: str) -> str:
    """Describe the worst misfit in one sentence. If all channels are off alike, name channel ``drive`` instead."""
    worst = max(misfits, key=lambda misfit: (misfit.warned, misfit.factor, bool(misfit.swapped_with)))
    if worst.swapped_with:
        return (
            f"channel {worst.channel} and channel {worst.swapped_with} seem swapped: the amplitudes fit the mode shapes with "
            "these two exchanged; look at both cables"
        )
    limit = f"{REFUSED_DEG if worst.refused else WARNED_DEG:g} deg"
    if worst.turn_deg is None:
        limit = f"a factor {REFUSED if worst.refused else worst.trusted:g}"
    bound = f"refused from {limit}" if worst.refused else f"warning above {limit}"
    alike = [
        one
        for one in misfits
        if one.by is worst.by and (one.turn_deg is None) is (worst.turn_deg is None) and not one.swapped_with
    ]
    off = [misfit for misfit in alike if misfit.warned]
    if len({misfit.channel for misfit in off}) > 1 and len(off) == len(alike) and _share_one_cause(off):
        names = ", ".join(misfit.channel for misfit in off)
        if worst.turn_deg is not None:
            return (
                f"channel {drive}: all others ({names}) are {_turn(worst.turn_deg)} it, expected 0 {worst.by.value}, "
                f"{bound}: look at what delays or advances its sensor (conditioner, filter, skew_samples)"
            )
        return (
            f"channel {drive}: all others ({names}) are {worst.times:.3g} times as large against it as expected "
            f"{worst.by.value}, {bound}: look at its sensor, cable and sensitivity_v_per_unit"
        )
    return f"{_what_was_seen(worst)} {worst.by.value}, {bound}: {_where_to_look(worst)}"


def _share_one_cause(off: Sequence[Misfit]) -> bool:
    turns = [misfit.turn_deg for misfit in off if misfit.turn_deg is not None]
    if turns:
        return max(turns) - min(turns) < 2.0 * ALIKE_DEG
    times = [misfit.times for misfit in off]
    return min(times) > 0.0 and max(times) < ALIKE**2 * min(times)


def _turn(turn_deg: float) -> str:
    return f"{abs(turn_deg):.3g} deg {'ahead of' if turn_deg > 0.0 else 'behind'}"


def _what_was_seen(misfit: Misfit) -> str:
    if misfit.turn_deg is not None:
        return f"channel {misfit.channel} is {_turn(misfit.turn_deg)} the drive channel, expected 0"
    if misfit.by is Reference.NOT_TRUSTED:
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
    if misfit.turn_deg is not None:
        return "look at what delays or advances one of the two sensors (conditioner, filter, skew_samples)"
    polarity = ", polarity" if misfit.seen < 0.0 else ""
    other = " and of the drive channel" if misfit.at else ""
    return f"look at sensor, cable{polarity} and sensitivity_v_per_unit of {misfit.channel}{other}"
