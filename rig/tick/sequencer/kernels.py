"""Compiled sequencer: steps through the segments and gives the present level, lag and frequency."""

import math

import numpy as np

from controller.kernels import LOCKED, LOST, STEEP_PERIODS, VOLTAGE, begin_ramp, forget_lag, reacquire
from rig.tick.safety.kernels import shut_down
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.judgement import (
    CLAMPED_PERIODS,
    SATURATED_PERIODS,
    failure_of,
    forget_periods,
    is_slipping,
    start_verdict,
    was_always_far,
)
from rig.tick.sequencer.layout import Drive, OnFailure, Outcome, SegmentKind
from rig.tick.sequencer.repetition import measure_again, note_result, step_is_over, too_many_faults
from vibrolock.compiled import Record, kernel

LONGEST_WAIT = 1000.0  # periods of a ramp that waits for the phase, as long as a point may settle; chosen
LONGEST_WAIT_FOR_HARMONICS = 300.0  # periods beyond its own that the start waits for the harmonics loop; chosen
NEAR_PERIODS = 2  # in a row: a knock ends no ramp; chosen
RETURN_PERIODS = 20.0  # of the way back to the last level with a lock
FIRST_PERIODS = 0.01  # of a record, from which on its length in samples is foretold
ARRIVED = 1e-3  # a ramp has ended if the output is this close to its end, relative to the larger of its two levels


@kernel
def close_segment(progress: Record, outcomes: np.ndarray, settling: Record, outcome: int) -> None:
    """Record how the present segment ended and move to the next segment."""
    entry = outcomes[progress.segment]
    note_result(entry, progress, settling, outcome)
    entry.distortion, entry.left_alone = settling.distortion, settling.left_alone
    progress.segment += 1
    progress.entered = 0


@kernel
def skip_point(progress: Record, segments: np.ndarray, outcomes: np.ndarray, lost: bool) -> None:
    """Skip the remaining segments of a failed point; after a ``lost`` lock also what follows above the last level with one."""
    failed = segments[progress.segment - 1]
    while progress.segment < progress.segments:
        segment = segments[progress.segment]
        above = lost and 0.0 < progress.kept_level < segment.level and segment.amplitude_law == failed.amplitude_law
        if segment.point != failed.point and not above:
            return
        entry = outcomes[progress.segment]
        entry.outcome = Outcome.SKIPPED
        entry.first_sample = progress.sample
        entry.end_sample = progress.sample
        progress.segment += 1


@kernel
def is_ramp(kind: int) -> bool:
    """Return whether a segment of this kind changes the level."""
    return kind in (SegmentKind.RAMP, SegmentKind.LEVEL_SWEEP)


@kernel
def give_up(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    lock: Record,
    guard: Record,
    failure: int,
) -> None:
    """Close a failed segment, then skip to the next point or end the run, as the plan demands.

    The run also ends if the start segment fails, if a limit is near before any level was held, or if the loop has never locked
    and its phase or frequency is as far off as with reversed feedback; the level is then not raised.
    """
    segment = segments[progress.segment]
    elapsed = progress.cycle - progress.start_cycle
    close_segment(progress, outcomes, settling, failure)
    far_off = failure == Outcome.OUTSIDE_WINDOW or was_always_far(lock, elapsed)
    lost = failure in (Outcome.LOST_LOCK, Outcome.TOO_STEEP, Outcome.NEAR_LIMIT)
    if failure == Outcome.NEAR_LIMIT and progress.kept_level == 0.0:
        progress.finished = 1
        shut_down(guard, EndReason.PLAN_STOPPED, -1, 0.0, progress.sample, False)
    elif segment.kind == SegmentKind.START or (progress.unlocked == 1 and segment.drive == Drive.LOOP and far_off):
        progress.finished = 1
        reason = EndReason.NO_LOCK_IN_WINDOW if failure == Outcome.OUTSIDE_WINDOW else EndReason.NO_LOCK
        shut_down(guard, reason, -1, 0.0, progress.sample, False)
    elif (segment.on_lost_lock if lost else segment.on_failure) == OnFailure.STOP:
        progress.finished = 1
        reason = EndReason.LOST_LOCK if failure == Outcome.LOST_LOCK else EndReason.PLAN_STOPPED
        shut_down(guard, reason, -1, 0.0, progress.sample, False)
    else:
        if lost:
            lock.state = LOST
        skip_point(progress, segments, outcomes, lost)


@kernel
def swept(segment: Record, start_omega: float, samples: int) -> float:
    """Return the frequency (rad/s) of a sweep in the middle of a sampling interval.

    Holding it over the interval gives the exact phase of a linear sweep.
    """
    increment = segment.rate * (samples + 0.5)
    omega = start_omega * math.exp(increment) if segment.logarithmic else start_omega + increment
    return float(min(omega, segment.omega) if segment.rate > 0.0 else max(omega, segment.omega))


@kernel
def between(start: float, end: float, rise: float) -> float:
    """Return the value at ``rise`` (0 to 1) from start to end, clamped so that rounding never exceeds either end.

    An end may coincide with a limit.
    """
    return float(min(max(start + (end - start) * rise, min(start, end)), max(start, end)))


@kernel
def ramped(start: float, end: float, rise: float, geometric: bool) -> float:
    """Return the level at ``rise`` (0 to 1) of a ramp, interpolated linearly or, if ``geometric``, by the logarithm."""
    if geometric and start > 0.0 and end > 0.0:
        return float(min(max(start * (end / start) ** rise, min(start, end)), max(start, end)))
    return between(start, end, rise)


@kernel
def has_arrived(segment: Record, start_level: float, amplitude_v: float) -> bool:
    """Return whether the output (V) has reached the end of a ramp; the slew limit may have held it back.

    Only ramps of the voltage of a tone or waveform wait for the output.
    """
    if segment.drive == Drive.LOOP or segment.amplitude_law != VOLTAGE:
        return True  # the settle rule waits for the output
    return bool(abs(amplitude_v - segment.level) <= ARRIVED * max(start_level, segment.level))


@kernel
def enter_segment(progress: Record, segments: np.ndarray, outcomes: np.ndarray, settling: Record, lock: Record) -> None:
    """Store the start values of a segment at its first sample."""
    segment, entry = segments[progress.segment], outcomes[progress.segment]
    progress.entered = 1
    progress.start_cycle = progress.cycle
    progress.start_sample = progress.sample
    progress.start_level = progress.level
    progress.start_omega = progress.omega
    progress.start_lag = progress.lag
    progress.last_cycle = progress.cycle
    progress.frozen_cycles = 0.0
    progress.waited_cycles = progress.slowed_cycles = 0.0
    progress.held = 0
    progress.continued = 0
    progress.lost = 0
    if segment.point != progress.point:
        progress.point = segment.point
        progress.tries_left = progress.retries
        progress.faulty_before = math.inf
    entry.outcome = Outcome.RUNNING
    entry.first_sample = progress.sample
    if is_ramp(segment.kind):
        begin_ramp(lock)
    if is_ramp(segment.kind) and lock.state == LOST:
        reacquire(lock)
        progress.returning = 1 if 0.0 < progress.kept_level < progress.level else 0
    if segment.kind == SegmentKind.SETTLE:
        forget_periods(settling)
    if segment.kind == SegmentKind.RELEASE:
        reacquire(lock)  # the lock is given up, not lost
        progress.start_level = 0.0  # readings that do not change are no fault while nothing drives
        progress.kept_level = 0.0


@kernel
def waits_for_phase(progress: Record, segment: Record) -> bool:
    """Return whether a segment is an upward ramp that waits for the phase of a loop that has been locked.

    Sweeps of the level do not wait.
    """
    climbs = segment.kind == SegmentKind.RAMP and segment.level > progress.level
    return bool(climbs and segment.drive == Drive.LOOP and progress.unlocked == 0)


@kernel
def is_held_by_window(progress: Record, segment: Record, settling: Record) -> bool:
    """Return whether the frequency stands at an end of its window during a ramp before the first lock, or one that waits."""
    watched = progress.unlocked == 1 or progress.waited_cycles > 0.0
    return bool(watched and settling.clamped_in_row >= CLAMPED_PERIODS and segment.drive == Drive.LOOP)


@kernel
def comes_near_a_limit(progress: Record, segment: Record, guard: Record) -> bool:
    """Return whether a level above the last one that was held, on its way or not yet settled, brings a reading near a limit."""
    rises = progress.kept_level < segment.level and segment.drive == Drive.LOOP
    return bool(rises and guard.near_periods >= NEAR_PERIODS)


@kernel
def has_returned(progress: Record, cycle: float) -> bool:
    """Lower the level to where a lock was last held; return whether it is there, where the ramp then begins."""
    done = min((cycle - progress.start_cycle) / RETURN_PERIODS, 1.0)
    progress.level = between(progress.start_level, progress.kept_level, 0.5 * (1.0 - math.cos(math.pi * done)))
    if done < 1.0:
        return False
    progress.returning = 0
    progress.start_cycle = cycle
    progress.start_level = progress.level
    return True


@kernel
def wants_harmonics(segment: Record, settling: Record, elapsed: float) -> bool:
    """Return whether a start or hold of so many ``elapsed`` periods goes on because the harmonics are not yet controlled."""
    return bool(settling.distortion > 1.0 and elapsed < segment.periods + LONGEST_WAIT_FOR_HARMONICS)


@kernel
def samples_of(segment: Record, samples: int, elapsed: float) -> float:
    """Return how many samples a record will have: so many ``samples`` have taken ``elapsed`` periods."""
    if segment.samples > 0:
        return float(segment.samples)
    return float(samples * max(segment.periods / max(elapsed, FIRST_PERIODS), 1.0))


@kernel
def is_refused_for_faults(
    progress: Record, segments: np.ndarray, outcomes: np.ndarray, settling: Record, planned: float, over: bool
) -> bool:
    """Refuse the present record, of ``planned`` samples, for faults of the device; return whether that ended it.

    With too many of them it is measured again, or its point given up. After a held output it is measured again if it may be.
    """
    fault = too_many_faults(progress, planned)
    if fault == Outcome.DONE:
        return bool(
            step_is_over(progress, over) and measure_again(progress, segments, outcomes, settling, Outcome.OUTPUT_HELD)
        )
    if not measure_again(progress, segments, outcomes, settling, fault, True):
        close_segment(progress, outcomes, settling, fault)
        skip_point(progress, segments, outcomes, False)
    return True


@kernel
def step_ramp(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    lock: Record,
    guard: Record,
    elapsed: float,
) -> None:
    """Set level, lag and frequency of a ramp that has taken ``elapsed`` periods; move on at its end, or give up."""
    segment = segments[progress.segment]
    lost = progress.frozen_cycles + progress.waited_cycles + progress.slowed_cycles
    done = min((elapsed - lost) / segment.periods, 1.0)
    rise = 0.5 * (1.0 - math.cos(math.pi * done))
    progress.level = ramped(progress.start_level, segment.level, rise, segment.geometric == 1)
    progress.lag = between(progress.start_lag, segment.lag_rad, rise)
    progress.omega = between(progress.start_omega, segment.omega, rise)
    if done >= 1.0 and has_arrived(segment, progress.start_level, guard.amplitude_v):
        if lock.state == LOCKED and segment.kind == SegmentKind.LEVEL_SWEEP:
            progress.kept_level = segment.level
        close_segment(progress, outcomes, settling, Outcome.DONE)
    elif is_held_by_window(progress, segment, settling):
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.OUTSIDE_WINDOW)
    elif progress.frozen_cycles >= SATURATED_PERIODS:
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.UNREACHABLE)
    elif lock.steep_periods >= STEEP_PERIODS:
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.TOO_STEEP)
    elif comes_near_a_limit(progress, segment, guard):
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.NEAR_LIMIT)
    elif progress.waited_cycles >= LONGEST_WAIT or (lock.state == LOST and waits_for_phase(progress, segment)):
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.LOST_LOCK)


@kernel
def advance(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    rule: Record,
    lock: Record,
    guard: Record,
) -> None:
    """Run the sequencer for one sample: set level, lag and frequency, move on after a segment, end the run after the last.

    The caller has set ``sample``, ``cycle`` and ``unreached`` of ``progress``. While the level is unreached an upward ramp
    waits; while the phase of a loop that has been locked is off it is slower, or waits. After a lost lock the next ramp begins
    where a lock was last held.
    """
    if progress.finished:
        return
    if guard.stop_requested == 1 and guard.mode == GuardMode.ARMED:
        shut_down(guard, EndReason.STOP_REQUESTED, -1, 0.0, progress.sample, False)
    if guard.mode != GuardMode.ARMED:
        guard.lock = lock.state
        if progress.entered:
            close_segment(progress, outcomes, settling, Outcome.INTERRUPTED)
        progress.finished = 1
        return
    if progress.segment >= progress.segments:
        progress.finished = 1
        shut_down(guard, EndReason.COMPLETED, -1, 0.0, progress.sample, False)
        return
    segment, cycle = segments[progress.segment], progress.cycle
    if not progress.entered:
        enter_segment(progress, segments, outcomes, settling, lock)
    passed = cycle - progress.last_cycle
    progress.last_cycle = cycle
    if lock.state == LOCKED:
        progress.unlocked = 0
    if progress.returning == 1 and not has_returned(progress, cycle):
        return
    climbs = is_ramp(segment.kind) and segment.level > progress.level
    if climbs and progress.unreached == 1:
        progress.frozen_cycles += passed
    elif climbs and waits_for_phase(progress, segment):
        if progress.held + progress.continued + progress.lost > 0:
            forget_lag(lock)
        progress.waited_cycles += passed * lock.slowing
        progress.slowed_cycles += passed * max(max(lock.steep_slowing, lock.lag_slowing) - lock.slowing, 0.0)
    elapsed, samples = cycle - progress.start_cycle, progress.sample - progress.start_sample
    if is_ramp(segment.kind):
        step_ramp(progress, segments, outcomes, settling, lock, guard, elapsed)
        return
    progress.level = segment.level
    if segment.kind == SegmentKind.SWEEP:
        progress.omega = swept(segment, progress.start_omega, samples)
        if progress.omega == segment.omega:
            close_segment(progress, outcomes, settling, Outcome.DONE)
        return
    progress.omega = segment.omega
    progress.lag = segment.lag_rad
    if segment.kind == SegmentKind.SETTLE and settling.good_periods >= rule.settled_periods:
        close_segment(progress, outcomes, settling, Outcome.DONE)
        return
    if segment.kind == SegmentKind.SETTLE or segment.kind == SegmentKind.RECORD:
        failure = failure_of(segment.kind, settling, rule, lock, elapsed, segment.periods)
        if segment.kind == SegmentKind.SETTLE and comes_near_a_limit(progress, segment, guard):
            failure = Outcome.NEAR_LIMIT
        if failure == Outcome.DISTURBED and measure_again(progress, segments, outcomes, settling, Outcome.DISTURBED):
            return
        if failure != Outcome.RUNNING:
            give_up(progress, segments, outcomes, settling, lock, guard, failure)
            return
    if segment.kind == SegmentKind.START and comes_near_a_limit(progress, segment, guard):
        give_up(progress, segments, outcomes, settling, lock, guard, Outcome.NEAR_LIMIT)
        return
    if segment.kind == SegmentKind.START and elapsed >= segment.periods:
        verdict = start_verdict(settling, lock, elapsed)
        if verdict == Outcome.DONE and lock.state == LOCKED and wants_harmonics(segment, settling, elapsed):
            return
        if verdict == Outcome.DONE and progress.held_back == 1:
            return
        if verdict == Outcome.DONE:
            close_segment(progress, outcomes, settling, Outcome.DONE)
        elif verdict != Outcome.RUNNING:
            give_up(progress, segments, outcomes, settling, lock, guard, verdict)
        return
    over = samples >= segment.samples if segment.samples > 0 else elapsed >= segment.periods
    if segment.kind == SegmentKind.RECORD and progress.held + progress.continued + progress.lost > 0:
        planned = samples_of(segment, samples, elapsed)
        if is_refused_for_faults(progress, segments, outcomes, settling, planned, over):
            return
    if segment.kind == SegmentKind.HOLD and wants_harmonics(segment, settling, elapsed):
        return
    if segment.kind != SegmentKind.SETTLE and over and not (segment.kind == SegmentKind.RECORD and is_slipping(lock)):
        spoilt = (
            segment.kind == SegmentKind.RECORD and settling.bad_periods > 0
        )  # it began to fail shortly before its end
        if spoilt and measure_again(progress, segments, outcomes, settling, Outcome.DISTURBED):
            return
        if lock.state == LOCKED and not spoilt:
            progress.kept_level = segment.level
        close_segment(progress, outcomes, settling, Outcome.DISTURBED if spoilt else Outcome.DONE)
