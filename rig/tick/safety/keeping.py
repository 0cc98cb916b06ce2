"""Compiled check, once a period, that a level is kept: not far exceeded, and with the output that it took before.

Both checks need a phase lock: a structure driven at a frequency of the plan may jump, which multiplies force and motion.

*Far above*: what is held may not exceed `FAR` times its level for `FAR_PERIODS`. After a change to a lower level the higher
one counts until the lower one was reached, because a vibration decays in its own time. With levels in volts the drive point's
motion is compared with that of the last check at this voltage. Friction raises the force per volt but not the motion per volt,
so the force counts only where the motion is above that of the check, too.

*Gain*: the output over what is held may not change by `LARGEST_CHANGE` within a level. Between levels the damping of the
structure changes, by the square root of the ratio of the levels at most (as for points,
`rig.campaigns.evaluation.plausibility`), and the force that a lag needs changes as the sine of the lag. Lags farther than 45
degrees from resonance are not compared. Where the exciter is known, what it explains of the change is left out, up to
`LARGEST_CHANGE`: it cannot tell a force sensor that fades from a structure that loses damping.
"""

import math

from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel

FAR = 3.0  # times its level; the build-up of a vibration does not take a force as large as this
FAR_PERIODS = 2  # in a row that trip; chosen: one may be a ramp that overshoots
ARRIVED = 1.5  # times a lower level; what is held has reached it below
SHAKEN_PERIODS = 10  # after a lock in which a level still counts: an amplifier that jumps in a ramp ends the lock
MOVES_MORE = 1.5  # times the motion that the last check foretells; from there on the force counts, too
AT_RESONANCE = 0.9  # sine of the lag from which on the last check foretells force and motion

LARGEST_CHANGE = 3.0  # factor of the gain that trips whatever the level explains; chosen
CHANGED_PERIODS = 10  # in a row that trip; chosen
NEAR = 0.1  # of its level; what is held is in order within it
IN_ORDER_PERIODS = 10  # in order in a row, after which the output of a level is known
COMPARED = 0.7  # sine of a lag below which levels are not compared: exciter and structure may cancel each other there

KEPT = record(
    i8="law trusted_periods far_periods in_order_periods changed_periods most_changed_periods",
    f8="level lag bound highest gain first_gain first_level first_lag first_needed factor",
)
"""State of both checks (one record).

``law``, ``level``, ``lag``: those of the last period. ``trusted_periods``: for how long the level still counts. ``bound``: the
level that counts; ``far_periods``: periods in a row far above it; ``highest``: the largest ratio to it so far.
``in_order_periods``: periods in a row in which what is held was near its level. ``gain``: output over what is held at the
beginning of this level, 0 until it is known; ``first_``: at the first level of this law, with what the known exciter needs of
it, 0 if unknown. ``factor``: by which the gain has changed beyond what is explained; ``changed_periods``: periods in a row
beyond `LARGEST_CHANGE`; ``most_changed_periods``: the most so far."""


@kernel
def begin_level(kept: Record, law: int, level: float, lag: float) -> None:
    """Forget the gain of the level before if this one is another; of all levels if another quantity is held."""
    if law != kept.law:
        kept.first_gain = kept.bound = 0.0
        kept.far_periods = 0
    if law != kept.law or level != kept.level or lag != kept.lag:
        kept.gain = 0.0
        kept.in_order_periods = 0
    kept.law, kept.level, kept.lag = law, level, lag


@kernel
def is_far_above(kept: Record, seen: float, level: float, locked: bool) -> bool:
    """Return whether what is ``seen`` has been far above its ``level`` for `FAR_PERIODS` in a row.

    A level counts under a lock, and for `SHAKEN_PERIODS` after it.
    """
    kept.trusted_periods = SHAKEN_PERIODS if locked else max(kept.trusted_periods - 1, 0)
    if level >= kept.bound or seen <= ARRIVED * level:
        kept.bound = level
    if kept.trusted_periods == 0 or kept.bound == 0.0:
        kept.far_periods = 0
        return False
    kept.far_periods = kept.far_periods + 1 if seen > FAR * kept.bound else 0
    kept.highest = max(kept.highest, seen / kept.bound)
    return bool(kept.far_periods >= FAR_PERIODS)


@kernel
def foretold_level(expected: Record, kept: Record, period: Record) -> float:
    """Return the voltage at which the last check foretells the motion of a ``period``; 0 if it foretells none."""
    if expected.checked_m_s2_v == 0.0 or abs(math.sin(kept.lag)) < AT_RESONANCE:
        return 0.0
    by_motion = period.drive_m_s2 / expected.checked_m_s2_v
    if by_motion > MOVES_MORE * max(kept.bound, period.output_v):
        return float(max(by_motion, period.force_n / expected.checked_n_v))
    return float(by_motion)


@kernel
def explained(kept: Record, held: float, needed: float) -> tuple[float, float]:
    """Return the lowest and highest ratio to the first gain that the level, the lag and the exciter explain.

    ``needed``: output over what is ``held`` that the known exciter needs, 0 if unknown.
    """
    levels = max(held / kept.first_level, kept.first_level / held)
    lags = abs(math.sin(kept.lag) / math.sin(kept.first_lag))
    highest = math.sqrt(levels) * max(lags, 1.0 / lags)
    lowest = 1.0 / highest
    if needed > 0.0 and kept.first_needed > 0.0:
        by_exciter = min(max(needed / kept.first_needed, 1.0 / LARGEST_CHANGE), LARGEST_CHANGE)
        lowest, highest = min(lowest, by_exciter), max(highest, by_exciter)
    return lowest, highest


@kernel
def gain_has_changed(
    kept: Record, held: float, output_v: float, needed_v: float, locked: bool, level_held: bool
) -> bool:
    """Return whether the output over what is ``held`` has changed more than is explained, for `CHANGED_PERIODS` in a row.

    ``needed_v``: output that the known exciter needs, 0 if unknown. ``level_held``: the level is not being ramped.
    """
    if not (locked and held > 0.0 and output_v > 0.0):
        kept.in_order_periods = kept.changed_periods = 0
        return False
    gain, needed = output_v / held, needed_v / held
    in_order = level_held and abs(held - kept.level) <= NEAR * kept.level
    kept.in_order_periods = kept.in_order_periods + 1 if in_order else 0
    if kept.in_order_periods >= IN_ORDER_PERIODS:
        if kept.gain == 0.0:
            kept.gain = gain
        if kept.first_gain == 0.0 and abs(math.sin(kept.lag)) >= COMPARED:
            kept.first_gain, kept.first_level, kept.first_lag, kept.first_needed = gain, held, kept.lag, needed
    kept.factor = 1.0
    if kept.gain > 0.0:
        kept.factor = max(gain / kept.gain, kept.gain / gain)
    if kept.first_gain > 0.0 and abs(math.sin(kept.lag)) >= COMPARED:
        lowest, highest = explained(kept, held, needed)
        ratio = gain / kept.first_gain
        kept.factor = max(kept.factor, ratio / highest, lowest / ratio)
    kept.changed_periods = kept.changed_periods + 1 if kept.factor > LARGEST_CHANGE else 0
    kept.most_changed_periods = max(kept.most_changed_periods, kept.changed_periods)
    return bool(kept.changed_periods >= CHANGED_PERIODS)
