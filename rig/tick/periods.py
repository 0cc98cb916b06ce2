"""Compiled end of a period: passes the period's means to lock state, settle rule and rig supervision."""

import math

from controller.harmonics import end_harmonics_period, left_alone
from controller.kernels import (
    FREQUENCY_ERROR,
    LOCKED,
    RESPONSE,
    VOLTAGE,
    end_period,
    foretold_slope,
    frequency_error,
    logarithmic_slope,
    mind_steepness,
    next_lock_state,
    size,
    steepness,
)
from rig.tick.layout import TickArrays
from rig.tick.safety.keeping import begin_level, foretold_level, gain_has_changed, is_far_above
from rig.tick.safety.kernels import shut_down
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.safety.response_plausibility import check_held_level, evaluate_exciter, silent_side
from rig.tick.sequencer.judgement import judge_period
from rig.tick.sequencer.kernels import waits_for_phase
from rig.tick.sequencer.layout import Drive, SegmentKind
from vibrolock.compiled import kernel


@kernel
def judge_response(t: TickArrays) -> None:
    """Trip if a law raises the output and the held quantity does not follow, or if force or motion shows no signal."""
    loop, control, guard, plausibility = t.loop[0], t.control[0], t.guard[0], t.plausibility[0]
    law, lock = control.amplitude.law, control.lock
    force, response = control.period.force_n, control.period.drive_m_s2
    evaluate_exciter(t.expected[0], plausibility, control.frequency.omega)
    if guard.mode != GuardMode.ARMED:
        return
    if loop.drive == Drive.LOOP and t.progress[0].unlocked == 1:
        side = silent_side(t.expected[0], plausibility, force, response)
        if side > 0:
            channel = loop.force_channel if side == 1 else loop.drive_channel
            shut_down(guard, EndReason.SENSOR_STUCK, channel, force if side == 1 else response, loop.sample, False)
    if law == VOLTAGE:
        return
    slipping, tone = lock.state == LOCKED and lock.out_of_band_periods > 0, loop.drive == Drive.TONE
    if check_held_level(t.expected[0], plausibility, control.period, t.progress[0].level, law, slipping, tone):
        channel = loop.drive_channel if law == RESPONSE else loop.force_channel
        value = response if law == RESPONSE else control.period.held
        shut_down(guard, EndReason.LEVEL_NOT_FOLLOWED, channel, value, loop.sample, False)


@kernel
def judge_keeping(t: TickArrays) -> None:
    """Trip if a level is far exceeded under a phase lock, or if it takes another output than before."""
    loop, control, guard, plausibility = t.loop[0], t.control[0], t.guard[0], t.plausibility[0]
    if guard.mode != GuardMode.ARMED or loop.drive != Drive.LOOP:
        return
    kept, period, law, lag = plausibility.kept, control.period, control.amplitude.law, t.progress[0].lag
    locked, volts = control.lock.state == LOCKED, law == VOLTAGE
    level = period.output_v if volts else t.progress[0].level
    channel = loop.drive_channel if volts or law == RESPONSE else loop.force_channel
    begin_level(kept, law, level, lag)
    seen = foretold_level(t.expected[0], kept, period) if volts else period.held
    if is_far_above(kept, seen, level, locked):
        value = period.drive_m_s2 if volts or law == RESPONSE else period.held
        shut_down(guard, EndReason.OVER_LEVEL, channel, value, loop.sample, False)
    if volts:
        return
    needed_v = size(plausibility.needed) if plausibility.told == 1 else 0.0
    if gain_has_changed(kept, period.held, period.output_v, needed_v, locked, loop.held == 1):
        shut_down(guard, EndReason.GAIN_CHANGED, channel, kept.factor, loop.sample, False)


@kernel
def end_harmonics(t: TickArrays) -> float:
    """Process the end of a period in the harmonics loop; return its largest error over its tolerance, 0 without the loop."""
    loop, control, progress, settling = t.loop[0], t.control[0], t.progress[0], t.settling[0]
    law, state = t.law[0].harmonics, control.harmonics
    if law.highest == 0:
        return 0.0
    recording = progress.entered == 1 and t.segments[progress.segment].kind == SegmentKind.RECORD
    free, amplitude_v = loop.held == 1 and not recording, control.amplitude.output.amplitude_v
    locked = loop.drive == Drive.TONE or control.lock.state == LOCKED
    end_harmonics_period(law, state, amplitude_v, locked, settling.steady == 1, free)
    settling.left_alone = left_alone(law, state)
    return float(state.miss)


@kernel
def mind_backbone(t: TickArrays) -> None:
    """Slow an upward ramp, or give it up, by how steep the backbone is where the vibration is, and how steep it is foretold.

    In a ramp the vibration lags behind its level, and the oscillator behind the resonance: the slope is that of the resonance
    over the amplitude, as the last period shows them; with the phase law that of the oscillator.
    """
    law, control, progress = t.law[0].frequency, t.control[0], t.progress[0]
    period, resonance = control.period, control.frequency.omega
    if law.law == FREQUENCY_ERROR:  # the phase law may not know the mode shape, and allows a lag of 0
        compliance = law.mode_shape_squared * period.force_n / period.drive_m_s2
        resonance += frequency_error(period.error_rad, compliance, resonance, progress.lag)
    target = t.segments[progress.segment].level
    here = logarithmic_slope(control.backbone, period.held, target, resonance)
    ahead = foretold_slope(control.backbone, target)
    mind_steepness(control.lock, steepness(law, here), steepness(law, ahead))


@kernel
def close_period(t: TickArrays) -> None:
    """Process the end of an oscillator period at the inputs."""
    loop, control = t.loop[0], t.control[0]
    period, amplitude, lock = control.period, control.amplitude, control.lock
    if not end_period(period):
        return
    control.frequency.mean_error_rad = period.error_rad
    guard = t.guard[0]
    guard.near_periods = guard.near_periods + 1 if guard.near == 1 else 0
    guard.near = 0
    if loop.drive in (Drive.WAVEFORM, Drive.SILENT):
        return
    present = control.vibration.present == 1
    if not present:
        period.error_rad = math.nan
    open_loop = loop.drive == Drive.TONE
    if not open_loop:
        progress = t.progress[0]
        waits = progress.entered == 1 and waits_for_phase(progress, t.segments[progress.segment])
        next_lock_state(lock, t.law[0].lock, present, loop.held == 1, period.error_rad, waits)
        lock.steep_slowing = 0.0
        bounded = t.law[0].frequency.most_hardening > 0.0
        if bounded and waits and present and amplitude.law == RESPONSE:
            mind_backbone(t)
    # If a loop holds the level, its own error decides; limits may clip the ripple of its output all the time.
    saturated = amplitude.output.saturation_sign != 0 and amplitude.law == VOLTAGE
    locked = (open_loop or lock.state == LOCKED) and not saturated
    period.output_v = guard.amplitude_v
    period.saturated, period.clamped = amplitude.saturated, control.frequency.clamped
    wanted = t.progress[0].level if amplitude.law != VOLTAGE else 0.0
    distortion = end_harmonics(t)
    judge_period(t.settling[0], t.rule[0], period, wanted, locked, open_loop or amplitude.law == RESPONSE, distortion)
    judge_response(t)
    judge_keeping(t)
