"""Feed-forward of the frequency along the backbone: while the level changes, the oscillator changes with it.

The frequency of phase resonance over the level is the parabola through the last three levels that were held with a lock (a line
through two, nothing for one; Newton's divided differences). What it misses is left to the PI law, whose integral it moves.
"""

import math

from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel

BACKBONE = record(i8="points", f8="level level_1 omega_1 level_2 omega_2 level_3 omega_3")
"""The last levels held with a lock (one record). ``level_1``, ``omega_1`` (rad/s): the last of ``points`` up to three;
``level``: the level at the last sample, in the unit of the plan's levels."""

MOST_POWER = 6.0  # of the level by which its slope is foretold to grow; chosen: a spring of seventh order has 6
LARGEST_RATIO = 3.0  # of the slope to that between the last two levels: the parabola is not believed beyond
NEAREST = 0.25
"""Part of a step of the level: levels nearer to each other tell no slope for that step, since noise would be multiplied."""


@inner_kernel
def forget_backbone(state: Record) -> None:
    """Forget the levels, whose unit changes."""
    state.points = 0


@inner_kernel
def add_to_backbone(state: Record, level: float, omega: float) -> None:
    """Add the frequency ``omega`` (rad/s) of a level held with a lock; a level held again replaces its earlier frequency."""
    if state.points > 0 and level == state.level_1:
        state.omega_1 = omega
        return
    state.level_3, state.omega_3 = state.level_2, state.omega_2
    state.level_2, state.omega_2 = state.level_1, state.omega_1
    state.level_1, state.omega_1 = level, omega
    state.points = min(state.points + 1, 3)


@inner_kernel
def backbone_slope(state: Record, level: float, target: float) -> float:
    """Return the change of frequency for the level, rad/s per unit of the level, at ``level`` on the way to ``target``.

    It has the sign of the slope between the last two levels, and at most `LARGEST_RATIO` times its size. It is 0 where these
    are nearer to each other than `NEAREST` times the step to the target, as the start's level and the first one may be.
    """
    apart, step = abs(state.level_1 - state.level_2), abs(target - state.level_1)
    if state.points < 2 or apart < NEAREST * step:
        return 0.0
    slope = (state.omega_1 - state.omega_2) / (state.level_1 - state.level_2)
    nearest = min(abs(state.level_2 - state.level_3), abs(state.level_1 - state.level_3))
    if state.points < 3 or slope == 0.0 or nearest < NEAREST * apart:
        return float(slope)
    earlier = (state.omega_2 - state.omega_3) / (state.level_2 - state.level_3)
    curvature = (slope - earlier) / (state.level_1 - state.level_3)
    ratio = 1.0 + curvature * (2.0 * level - state.level_1 - state.level_2) / slope
    return float(slope * min(max(ratio, 0.0), LARGEST_RATIO))


@inner_kernel
def logarithmic_slope(state: Record, level: float, target: float, omega: float) -> float:
    """Return d ln(frequency)/d ln(level) at a level on the way up to ``target``, whose frequency is ``omega`` (rad/s).

    It is that of the parabola through this level and the last two that were held, or of the line from the last one where these
    two are near to each other. It is 0 near to the last level, whence noise would be multiplied, and below it.
    """
    step, before = level - state.level_1, state.level_1 - state.level_2
    if state.points < 2 or before <= 0.0 or step < NEAREST * max(before, target - state.level_1):
        return 0.0
    slope = (omega - state.omega_1) / step
    if before >= NEAREST * step:
        slope += (slope - (state.omega_1 - state.omega_2) / before) * step / (step + before)
    return float(slope * level / omega)


@inner_kernel
def foretold_slope(state: Record, target: float) -> float:
    """Return d ln(frequency)/d ln(level) at a higher level, as the last three levels foretell it.

    The slope grows by the power of the level by which it grew between them, at most by `MOST_POWER`; 0 if it did not grow, or
    changed its sign.
    """
    if state.points < 3 or not 0.0 < state.level_3 < state.level_2 < state.level_1 < target:
        return 0.0
    last = math.log(state.omega_1 / state.omega_2) / math.log(state.level_1 / state.level_2)
    before = math.log(state.omega_2 / state.omega_3) / math.log(state.level_2 / state.level_3)
    if last * before <= 0.0 or abs(last) <= abs(before):
        return 0.0
    power = 2.0 * math.log(last / before) / math.log(state.level_1 / state.level_3)
    return float(last * (target / math.sqrt(state.level_1 * state.level_2)) ** min(power, MOST_POWER))


@inner_kernel
def steepness(parameters: Record, slope: float) -> float:
    """Return a ``slope`` of the backbone, d ln(frequency)/d ln(level), over the steepest one that the gains bear.

    It is 0 where that is unknown.
    """
    most = parameters.most_hardening if slope > 0.0 else parameters.most_softening
    return float(abs(slope) / most if most > 0.0 else 0.0)


@inner_kernel
def follow_backbone(state: Record, frequency: Record, level: float, target: float, ramps: bool) -> None:
    """Move the integral of the frequency law for the change of the level since the last sample, if it ``ramps`` to a target."""
    if ramps:
        frequency.integral += backbone_slope(state, 0.5 * (level + state.level), target) * (level - state.level)
    state.level = level
