"""Compiled judgement of every period: the settle rule, and whether a segment has failed."""

import math

import numpy as np

from controller.kernels import LOCKED, LOST, SEARCHING
from rig.tick.sequencer.layout import Outcome, SegmentKind
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel

SATURATED_PERIODS = 20  # in a row at the voltage limit after which a level is out of reach; chosen
CLAMPED_PERIODS = 20  # in a row at an end of the window after which there is no lock; chosen
FAR_PERIODS = 100  # longer than a lightly damped mode decays; a lock that swings at constant voltage is near by then
LOST_FACTOR = 3.0  # while recording, an averaged error or drift beyond this multiple of the tolerance spoils the point

SETTLE_RULE = record(f8="phase_rad amplitude", i8="average_periods settled_periods")
"""The settle rule (one record); see `judge_period`."""

LONGEST_AVERAGE = 64  # periods that the ring holds

SETTLING = record(
    ("errors", "f8", (2 * LONGEST_AVERAGE,)),
    ("responses", "f8", (2 * LONGEST_AVERAGE,)),
    ("forces", "f8", (2 * LONGEST_AVERAGE,)),
    ("controlled", "f8", (2 * LONGEST_AVERAGE,)),
    i8="count steady left_alone good_periods bad_periods saturated_periods clamped_periods clamped_in_row",
    f8="distortion mean_error_rad drift",
)
"""Means of the last periods, as rings, and the state of the settle rule (one record). ``clamped_in_row`` counts the present run
of periods with clamped frequency; ``clamped_periods`` counts those of that run that the settle rule has judged."""


@kernel
def mean_of(ring: np.ndarray, last: int, periods: int) -> float:
    """Return the mean over ``periods`` entries of a ring up to entry number ``last`` (counted from 0 since the start)."""
    total = 0.0
    for back in range(periods):
        total += ring[(last - back) % (2 * LONGEST_AVERAGE)]
    return total / periods


@kernel
def judge_period(
    settling: Record, rule: Record, period: Record, wanted: float, locked: bool, watch_force: bool, distortion: float
) -> None:
    """Store the means of a ``period`` (of `controller.period.PERIOD`) and apply the settle rule.

    The vibration is settled if the following holds for ``settled_periods`` in a row. The loop is locked. The phase error
    averaged over ``average_periods`` is within ``phase_rad``. The averaged response amplitude is within ``amplitude``
    (relative) of its average ``average_periods`` before. If a loop holds the level, the average of the held quantity is within
    ``amplitude`` of ``wanted`` (0: no loop). With ``watch_force`` (open loop, held response) the averaged force must not change
    by more than ``amplitude`` either. ``distortion`` is the largest error of the controlled harmonics over its tolerance, 0
    without any; it must not exceed 1. Apart from it the vibration is ``steady``.
    """
    n = rule.average_periods
    slot = settling.count % (2 * LONGEST_AVERAGE)
    settling.errors[slot] = period.error_rad
    settling.responses[slot] = period.drive_m_s2
    settling.forces[slot] = period.force_n
    settling.controlled[slot] = period.held
    settling.clamped_in_row = settling.clamped_in_row + 1 if period.clamped == 1 else 0
    last = settling.count
    settling.count += 1
    if settling.count < 2 * n:
        return
    settling.mean_error_rad = mean_of(settling.errors, last, n)
    new, old = mean_of(settling.responses, last, n), mean_of(settling.responses, last - n, n)
    drift = (new - old) / new if new > 0.0 else math.inf
    if wanted > 0.0:
        miss = mean_of(settling.controlled, last, n) / wanted - 1.0
        drift = miss if abs(miss) > abs(drift) else drift
    if watch_force:
        new = mean_of(settling.forces, last, n)
        moved = (new - mean_of(settling.forces, last - n, n)) / new if new > 0.0 else math.inf
        drift = moved if abs(moved) > abs(drift) else drift
    settling.drift = drift
    off = math.inf  # also if no phase could be read
    if math.isfinite(settling.mean_error_rad):
        off = max(abs(settling.mean_error_rad) / rule.phase_rad, abs(drift) / rule.amplitude)
    settling.steady = 1 if locked and off <= 1.0 else 0
    settling.distortion = distortion
    off = max(off, distortion)
    settling.good_periods = settling.good_periods + 1 if locked and off <= 1.0 else 0
    settling.bad_periods = settling.bad_periods + 1 if off > LOST_FACTOR else 0
    unreached = period.saturated == 1 and abs(drift) > 2.0 * rule.amplitude
    settling.saturated_periods = settling.saturated_periods + 1 if unreached else 0
    settling.clamped_periods = settling.clamped_periods + 1 if period.clamped == 1 else 0


@kernel
def forget_periods(settling: Record) -> None:
    """Reset the settle rule: periods before the level was reached do not count."""
    settling.count = 0
    settling.steady = 0
    settling.good_periods = 0
    settling.bad_periods = 0
    settling.saturated_periods = 0
    settling.clamped_periods = 0
    settling.mean_error_rad = math.nan
    settling.drift = math.nan


@kernel
def is_slipping(lock: Record) -> bool:
    """Return whether a lock is about to be lost: the error is large, but not yet for long enough.

    Any other failure of a segment is then put down to the loss of the lock.
    """
    return bool(lock.state == LOCKED and lock.out_of_band_periods > 0)


@kernel
def failure_of(kind: int, settling: Record, rule: Record, lock: Record, elapsed: float, periods: float) -> int:
    """Return the outcome code of a held segment that has failed, or RUNNING."""
    if lock.state == LOST:
        return Outcome.LOST_LOCK
    if settling.saturated_periods >= SATURATED_PERIODS:
        return Outcome.UNREACHABLE
    if settling.clamped_periods >= CLAMPED_PERIODS:
        return Outcome.OUTSIDE_WINDOW
    if is_slipping(lock):
        return Outcome.RUNNING
    if kind == SegmentKind.RECORD and settling.bad_periods >= rule.average_periods:
        return Outcome.DISTURBED
    if kind == SegmentKind.SETTLE and elapsed >= periods:
        return Outcome.NOT_SETTLED
    return Outcome.RUNNING


@kernel
def was_always_far(lock: Record, elapsed: float) -> bool:
    """Return whether the phase error was that of a lost lock in every period of a segment, and in at least 100 periods."""
    return bool(lock.out_of_band_periods >= max(FAR_PERIODS, math.floor(elapsed) - 1))


@kernel
def start_verdict(settling: Record, lock: Record, elapsed: float) -> int:
    """Judge the start segment after its time has run out: return DONE, the code of a failure, or RUNNING while in doubt.

    A lock is not required, because a lock may swing in and out at constant voltage. The start fails if force or motion is too
    small to be read, if the frequency is at an end of its window for 20 periods, or if the phase error was that of a lost lock
    in every period so far and in at least 100 periods.
    """
    if lock.state == LOCKED:
        return Outcome.DONE
    if lock.state == SEARCHING:
        return Outcome.NOT_SETTLED
    if settling.clamped_in_row >= CLAMPED_PERIODS:
        return Outcome.OUTSIDE_WINDOW
    if was_always_far(lock, elapsed):
        return Outcome.NOT_LOCKED
    always_far = lock.out_of_band_periods > 0 and lock.out_of_band_periods >= math.floor(elapsed) - 1
    return Outcome.RUNNING if always_far or settling.clamped_in_row > 0 else Outcome.DONE
