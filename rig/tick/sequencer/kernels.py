"""Compiled sequencer: judges every period, steps through the segments, and gives the level of the moment."""

import math

import numpy as np

from controller.layout import LOCKED, LOST, SEARCHING, VOLTAGE
from controller.lock.kernels import reacquire
from rig.tick.safety.kernels import shut_down
from rig.tick.safety.layout import ARMED, EndReason
from rig.tick.sequencer.layout import (
    LEVEL_SWEEP,
    LONGEST_AVERAGE,
    LOOP_DRIVE,
    RAMP,
    RECORD,
    SETTLE,
    START,
    SWEEP,
    OnFailure,
    Outcome,
)
from vibrolock.compiled import Record, kernel

COMPLETED = int(EndReason.COMPLETED)
STOP_REQUESTED = int(EndReason.STOP_REQUESTED)
PLAN_STOPPED = int(EndReason.PLAN_STOPPED)
TRIP_LOST_LOCK = int(EndReason.LOST_LOCK)
NO_LOCK_IN_WINDOW = int(EndReason.NO_LOCK_IN_WINDOW)
NO_LOCK = int(EndReason.NO_LOCK)

RUNNING = int(Outcome.RUNNING)
DONE = int(Outcome.DONE)
NOT_SETTLED = int(Outcome.NOT_SETTLED)
DISTURBED = int(Outcome.DISTURBED)
LOST_LOCK = int(Outcome.LOST_LOCK)
UNREACHABLE = int(Outcome.UNREACHABLE)
SKIPPED = int(Outcome.SKIPPED)
INTERRUPTED = int(Outcome.INTERRUPTED)
OUTSIDE_WINDOW = int(Outcome.OUTSIDE_WINDOW)
NOT_LOCKED = int(Outcome.NOT_LOCKED)
STOP = int(OnFailure.STOP)

SATURATED_PERIODS = 20
CLAMPED_PERIODS = 20
FAR_PERIODS = 100  # a lock that swings at plain voltage comes near within the memory of a lightly damped mode
ARRIVED = 1e-3  # the output within this part of the larger of a ramp's levels is at its end
LOST_FACTOR = 3.0  # while recording, an averaged error or drift beyond this multiple of the tolerance spoils the point


@kernel
def mean_of(ring: np.ndarray, last: int, periods: int) -> float:
    """Mean of the ``periods`` entries of a ring that end with entry number ``last`` (counted from 0 since the start)."""
    total = 0.0
    for back in range(periods):
        total += ring[(last - back) % (2 * LONGEST_AVERAGE)]
    return total / periods


@kernel
def judge_period(
    settling: Record,
    rule: Record,
    locked: bool,
    error: float,
    response: float,
    force: float,
    wanted: float,
    controlled: float,
    saturated: bool,
    clamped: bool,
    watch_force: bool,
) -> None:
    """Take in one period's means and apply the settle rule.

    Settled is: the loop is locked, the phase error averaged over ``average_periods`` stays within ``phase_rad``, and the
    averaged response amplitude within ``amplitude`` (relative) of what it was that many periods before, for
    ``settled_periods`` in a row. Where a loop holds the level, what it controls must on average be within ``amplitude`` of
    what is ``wanted`` (0: there is no loop). With ``watch_force`` (open loop, held response) the force must keep still too.
    """
    n = rule.average_periods
    slot = settling.count % (2 * LONGEST_AVERAGE)
    settling.errors[slot] = error
    settling.responses[slot] = response
    settling.forces[slot] = force
    settling.controlled[slot] = controlled
    settling.clamped_in_row = settling.clamped_in_row + 1 if clamped else 0
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
    off = math.inf  # where a phase could not be read, too
    if math.isfinite(settling.mean_error_rad):
        off = max(abs(settling.mean_error_rad) / rule.phase_rad, abs(drift) / rule.amplitude)
    settling.good_periods = settling.good_periods + 1 if locked and off <= 1.0 else 0
    settling.bad_periods = settling.bad_periods + 1 if off > LOST_FACTOR else 0
    unreached = saturated and abs(drift) > 2.0 * rule.amplitude
    settling.saturated_periods = settling.saturated_periods + 1 if unreached else 0
    settling.clamped_periods = settling.clamped_periods + 1 if clamped else 0


@kernel
def forget_periods(settling: Record) -> None:
    """Begin a new settling: periods before the level was reached do not count."""
    settling.count = 0
    settling.good_periods = 0
    settling.bad_periods = 0
    settling.saturated_periods = 0
    settling.clamped_periods = 0
    settling.mean_error_rad = math.nan
    settling.drift = math.nan


@kernel
def is_slipping(lock: Record) -> bool:
    """Whether a lock is about to be lost: far off, but not for long enough. What fails meanwhile fails for that."""
    return bool(lock.state == LOCKED and lock.far_periods > 0)


@kernel
def failure_of(kind: int, settling: Record, rule: Record, lock: Record, elapsed: float, periods: float) -> int:
    """Outcome code of a held segment that has failed, or RUNNING."""
    if lock.state == LOST:
        return LOST_LOCK
    if settling.saturated_periods >= SATURATED_PERIODS:
        return UNREACHABLE
    if settling.clamped_periods >= CLAMPED_PERIODS:
        return OUTSIDE_WINDOW
    if is_slipping(lock):
        return RUNNING
    if kind == RECORD and settling.bad_periods >= rule.average_periods:
        return DISTURBED
    if kind == SETTLE and elapsed >= periods:
        return NOT_SETTLED
    return RUNNING


@kernel
def was_always_far(lock: Record, elapsed: float) -> bool:
    """Whether the phase was that of a lost lock in every period of a segment, and in 100 at the least."""
    return bool(lock.far_periods >= max(FAR_PERIODS, math.floor(elapsed) - 1))


@kernel
def start_verdict(settling: Record, lock: Record, elapsed: float) -> int:
    """Whether the time at the start voltage, over by its length, ends: DONE, a failure's code, or RUNNING while in doubt.

    No lock is needed, for one may swing in and out at plain voltage. Refused is a force or motion too small to be read, a
    frequency that stands at an end of its window for 20 periods, or a phase error that was that of a lost lock in every
    period so far, for 100 at the least.
    """
    if lock.state == LOCKED:
        return DONE
    if lock.state == SEARCHING:
        return NOT_SETTLED
    if settling.clamped_in_row >= CLAMPED_PERIODS:
        return OUTSIDE_WINDOW
    if was_always_far(lock, elapsed):
        return NOT_LOCKED
    always_far = lock.far_periods > 0 and lock.far_periods >= math.floor(elapsed) - 1
    return RUNNING if always_far or settling.clamped_in_row > 0 else DONE


@kernel
def close_segment(
    progress: Record, outcomes: np.ndarray, settling: Record, outcome: int, cycle: float, sample: int
) -> None:
    """Write down how the present segment ended and move to the next."""
    entry = outcomes[progress.segment]
    entry.outcome = outcome
    entry.end_sample = sample
    entry.periods = cycle - progress.start_cycle
    entry.mean_error_rad = settling.mean_error_rad
    entry.drift = settling.drift
    progress.segment += 1
    progress.entered = 0


@kernel
def skip_point(progress: Record, segments: np.ndarray, outcomes: np.ndarray, sample: int) -> None:
    """Pass over what is left of a failed point."""
    point = segments[progress.segment - 1].point
    while progress.segment < progress.segments and segments[progress.segment].point == point:
        entry = outcomes[progress.segment]
        entry.outcome = SKIPPED
        entry.first_sample = sample
        entry.end_sample = sample
        progress.segment += 1


@kernel
def is_ramp(kind: int) -> bool:
    """Whether a segment changes the level."""
    return kind in (RAMP, LEVEL_SWEEP)


@kernel
def give_up(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    lock: Record,
    guard: Record,
    failure: int,
    cycle: float,
    sample: int,
) -> None:
    """The present segment has failed: on to the next point, or end the run, as its plan wants it.

    A loop that never had a lock and is as far off as one that feeds back the wrong way ends it, before the level rises.
    """
    segment = segments[progress.segment]
    elapsed = cycle - progress.start_cycle
    close_segment(progress, outcomes, settling, failure, cycle, sample)
    far_off = failure == OUTSIDE_WINDOW or was_always_far(lock, elapsed)
    if segment.kind == START or (progress.unlocked == 1 and segment.drive == LOOP_DRIVE and far_off):
        progress.finished = 1
        shut_down(guard, NO_LOCK_IN_WINDOW if failure == OUTSIDE_WINDOW else NO_LOCK, -1, 0.0, sample, False)
    elif (segment.on_lost_lock if failure == LOST_LOCK else segment.on_failure) == STOP:
        progress.finished = 1
        shut_down(guard, TRIP_LOST_LOCK if failure == LOST_LOCK else PLAN_STOPPED, -1, 0.0, sample, False)
    else:
        skip_point(progress, segments, outcomes, sample)


@kernel
def swept(segment: Record, start_omega: float, samples: int) -> float:
    """Frequency (rad/s) of a sweep in the middle of a sampling interval: held over it, a linear one has its exact phase."""
    way = segment.rate * (samples + 0.5)
    omega = start_omega * math.exp(way) if segment.logarithmic else start_omega + way
    return float(min(omega, segment.omega) if segment.rate > 0.0 else max(omega, segment.omega))


@kernel
def between(start: float, end: float, rise: float) -> float:
    """Value at ``rise`` (0 to 1) of the way; never beyond either end, where a limit may be: rounding would go there."""
    return float(min(max(start + (end - start) * rise, min(start, end)), max(start, end)))


@kernel
def ramped(start: float, end: float, rise: float, geometric: bool) -> float:
    """Level at ``rise`` (0 to 1) of a ramp, by its value or its logarithm."""
    if geometric and start > 0.0 and end > 0.0:
        return float(min(max(start * (end / start) ** rise, min(start, end)), max(start, end)))
    return between(start, end, rise)


@kernel
def has_arrived(segment: Record, start_level: float, amplitude_v: float) -> bool:
    """Whether the output (V) is where a ramp of tone or waveform ends: the slew limit may have held it back."""
    if segment.drive == LOOP_DRIVE or segment.amplitude_law != VOLTAGE:
        return True  # its settle rule waits for the output
    return bool(abs(amplitude_v - segment.level) <= ARRIVED * max(start_level, segment.level))


@kernel
def advance(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    rule: Record,
    lock: Record,
    guard: Record,
    cycle: float,
    sample: int,
    unreached: bool,
) -> None:
    """One sample of the sequencer: sets level, lag and frequency, moves on when a segment is over, ends the run after the last.

    ``cycle`` is the number of oscillator periods seen by the inputs so far, with its fraction. ``unreached``: the output stands
    at its limit and the level of the moment is not reached; a ramp that goes up waits then.
    """
    if progress.finished:
        return
    if guard.stop_requested == 1 and guard.mode == ARMED:
        shut_down(guard, STOP_REQUESTED, -1, 0.0, sample, False)
    if guard.mode != ARMED:
        guard.lock = lock.state
        if progress.entered:
            close_segment(progress, outcomes, settling, INTERRUPTED, cycle, sample)
        progress.finished = 1
        return
    if progress.segment >= progress.segments:
        progress.finished = 1
        shut_down(guard, COMPLETED, -1, 0.0, sample, False)
        return
    segment = segments[progress.segment]
    if not progress.entered:
        progress.entered = 1
        progress.start_cycle = cycle
        progress.start_sample = sample
        progress.start_level = progress.level
        progress.start_omega = progress.omega
        progress.start_lag = progress.lag
        progress.last_cycle = cycle
        progress.frozen_cycles = 0.0
        outcomes[progress.segment].outcome = RUNNING
        outcomes[progress.segment].first_sample = sample
        if is_ramp(segment.kind) and lock.state == LOST:
            reacquire(lock)
        if segment.kind == SETTLE:
            forget_periods(settling)
    if unreached and is_ramp(segment.kind) and segment.level > progress.level:
        progress.frozen_cycles += cycle - progress.last_cycle
    progress.last_cycle = cycle
    if lock.state == LOCKED:
        progress.unlocked = 0
    elapsed = cycle - progress.start_cycle
    if is_ramp(segment.kind):
        done = min((elapsed - progress.frozen_cycles) / segment.periods, 1.0)
        rise = 0.5 * (1.0 - math.cos(math.pi * done))
        progress.level = ramped(progress.start_level, segment.level, rise, segment.geometric == 1)
        progress.lag = between(progress.start_lag, segment.lag_rad, rise)
        progress.omega = between(progress.start_omega, segment.omega, rise)
        if done >= 1.0 and has_arrived(segment, progress.start_level, guard.amplitude_v):
            close_segment(progress, outcomes, settling, DONE, cycle, sample)
        elif progress.unlocked == 1 and settling.clamped_in_row >= CLAMPED_PERIODS and segment.drive == LOOP_DRIVE:
            give_up(progress, segments, outcomes, settling, lock, guard, OUTSIDE_WINDOW, cycle, sample)
        elif progress.frozen_cycles >= SATURATED_PERIODS:
            give_up(progress, segments, outcomes, settling, lock, guard, UNREACHABLE, cycle, sample)
        return
    progress.level = segment.level
    if segment.kind == SWEEP:
        progress.omega = swept(segment, progress.start_omega, sample - progress.start_sample)
        if progress.omega == segment.omega:
            close_segment(progress, outcomes, settling, DONE, cycle, sample)
        return
    progress.omega = segment.omega
    progress.lag = segment.lag_rad
    if segment.kind == SETTLE and settling.good_periods >= rule.settled_periods:
        close_segment(progress, outcomes, settling, DONE, cycle, sample)
        return
    if segment.kind == SETTLE or segment.kind == RECORD:
        failure = failure_of(segment.kind, settling, rule, lock, elapsed, segment.periods)
        if failure != RUNNING:
            give_up(progress, segments, outcomes, settling, lock, guard, failure, cycle, sample)
            return
    if segment.kind == START and elapsed >= segment.periods:
        verdict = start_verdict(settling, lock, elapsed)
        if verdict == DONE:
            close_segment(progress, outcomes, settling, DONE, cycle, sample)
        elif verdict != RUNNING:
            give_up(progress, segments, outcomes, settling, lock, guard, verdict, cycle, sample)
        return
    over = sample - progress.start_sample >= segment.samples if segment.samples > 0 else elapsed >= segment.periods
    if segment.kind != SETTLE and over and not (segment.kind == RECORD and is_slipping(lock)):
        spoilt = segment.kind == RECORD and settling.bad_periods > 0  # it began to fail shortly before its end
        close_segment(progress, outcomes, settling, DISTURBED if spoilt else DONE, cycle, sample)
