"""The compiled tick, once, for every driver: per sample, per block, or fused with a virtual rig.

Order within one sample: measure, take out the mean, demodulate against the phase that was on the output when the
reading was made, lock state, sequencer, frequency law, amplitude law, safety, act, telemetry row.
"""

import math

import numpy as np

from controller.kernels import (
    TWO_PI,
    advance_phase,
    demodulate,
    next_lock_state,
    phase_lag,
    proportional_integral,
    sign_product,
    size,
    track,
    wrap,
)
from controller.layout import FORCE, LOCKED, SIGN
from rig.safety.kernels import (
    NON_FINITE_OUTPUT,
    SENSOR_OVERLOAD,
    permitted_amplitude,
    shut_down,
    watch_frequency,
    watch_input,
    watch_motion,
)
from rig.safety.layout import ARMED
from rig.sequencer.kernels import advance, judge_period
from rig.sequencer.layout import LOOP_DRIVE, RAMP, TONE, WAVEFORM
from rig.tick.layout import DEVICE_SHIFT, FREQUENCY_CLAMPED, HELD, SATURATED, SENSOR_AT_RANGE, TickArrays
from vibrolock.compiled import Record, kernel

STUCK_SAMPLES = 16  # equal readings in a row, more than a turning point of a vibration worth watching has
HELD_BACK = 1e-3  # an output further than this part from what the law demands is not at its level


@kernel
def phase_on_output(history: np.ndarray, seen: int, lead_fraction: float, dt: float) -> float:
    """Oscillator phase that was on the output when this sample's inputs were measured, in [0, 2 pi).

    ``seen`` is the ring's entry of the last whole sample that the inputs show.
    """
    before = seen - 1 if seen > 0 else history.size - 1
    theta = history[seen].theta - lead_fraction * dt * history[before].omega
    return float(theta + TWO_PI if theta < 0.0 else theta)


@kernel
def examine_input(t: TickArrays, index: int, volts: float, driven: bool) -> tuple[bool, bool]:
    """A reading that is not plainly in order: watch it; returns whether it may be used, and whether it is a motion.

    A reading beyond its limit trips, and so does a faulty sensor: integrated, the fault would pass for travel. So would the
    gap that is left without it: from then on the channel tells nothing of a motion any more.
    """
    guard, limits, loop = t.guard[0], t.limits[0], t.loop[0]
    channel, watch = t.inputs[index], t.watches[index]
    usable = watch_input(guard, limits, channel, watch, index, volts, loop.sample, driven)
    within = usable and abs(volts * channel.unit_per_volt) <= channel.limit
    if not within or (guard.channel == index and guard.reason >= SENSOR_OVERLOAD):
        watch.distrusted = 1
    return usable, watch.distrusted == 0 and watch.same_samples < STUCK_SAMPLES


@kernel
def estimate_inputs(t: TickArrays, volts: np.ndarray, readings: np.ndarray, cos_theta: float, sin_theta: float) -> int:
    """Check, convert and demodulate every input channel; returns the telemetry flags of the inputs."""
    law, loop, guard, limits = t.law[0], t.loop[0], t.guard[0], t.limits[0]
    armed = guard.mode == ARMED
    driven = armed and loop.held == 1
    # At first the mean of all samples so far: noise or ambient vibration in a single one would be integrated as travel.
    mean_gain, gain = max(law.mean_gain, 1.0 / (loop.sample + 1.0)), law.demodulator_gain
    flags = 0
    force = 0.0
    drive = 0.0
    for index in range(t.inputs.size):
        channel, watch = t.inputs[index], t.watches[index]
        volt = volts[index]
        value = volt * channel.unit_per_volt
        readings[index] = value
        moves = True
        in_order = armed and abs(volt) < channel.alarm_v and volt != watch.last_v and watch.alert == 0
        if in_order:
            watch.last_v = volt
        else:
            usable, moves = examine_input(t, index, volt, driven)
            if not usable:
                continue
            if watch.overload_samples > 0:
                flags |= SENSOR_AT_RANGE
        mean = track(watch.mean, value, mean_gain)
        watch.mean = mean
        value -= mean
        watch.estimate = demodulate(watch.estimate, value, cos_theta, sin_theta, gain)
        if index == loop.force_channel:
            force = value
        if index == loop.drive_channel:
            drive = value
        if channel.watch_displacement == 1 and moves:
            watch_motion(guard, limits, watch, value, index, loop.sample)
    if law.detector == SIGN:
        loop.sign_mean = track(loop.sign_mean, sign_product(force, drive), gain)
    return flags


@kernel
def phase_error(t: TickArrays, force: complex, drive: complex) -> float:
    """Wanted minus measured phase lag in rad, by the detector of the plan, with the channels' skew taken out."""
    law, loop = t.law[0], t.loop[0]
    skew = t.inputs[loop.force_channel].skew_samples - t.inputs[loop.drive_channel].skew_samples
    lag_of_skew = loop.omega * skew * law.dt_s
    if law.detector == SIGN:
        return float(0.5 * math.pi * loop.sign_mean - lag_of_skew)
    return wrap(law.target_lag_rad - phase_lag(force, drive) - lag_of_skew)


@kernel
def close_period(t: TickArrays, present: bool) -> None:
    """An oscillator period has ended at the inputs: lock state and settle rule take its means."""
    law, loop = t.law[0], t.loop[0]
    n = loop.sum_samples
    if n > 0:
        loop.mean_error = loop.sum_error / n
    if n > 0 and loop.drive != WAVEFORM:
        error = loop.sum_error / n if present else math.nan
        open_loop = loop.drive == TONE
        if not open_loop:
            next_lock_state(t.lock[0], t.thresholds[0], present, loop.held == 1, error)
        wanted = t.progress[0].level if law.amplitude_law == FORCE else 0.0
        locked = (open_loop or t.lock[0].state == LOCKED) and loop.held_back == 0
        judge_period(
            t.settling[0],
            t.rule[0],
            locked,
            error,
            loop.sum_response / n,
            loop.sum_force / n,
            wanted,
            loop.saturated == 1,
            open_loop,
        )
    loop.sum_error = 0.0
    loop.sum_response = 0.0
    loop.sum_force = 0.0
    loop.sum_samples = 0


@kernel
def demanded_amplitude(t: TickArrays, force_amplitude: float) -> float:
    """Amplitude law: the output amplitude (V) for the level of the moment."""
    law, loop, level = t.law[0], t.loop[0], t.progress[0].level
    if law.amplitude_law == FORCE:
        demanded, loop.amplitude_integral = proportional_integral(
            level - force_amplitude, loop.amplitude_integral, law.k3, law.k4, law.dt_s, 0.0, 0.0, law.largest_v
        )
    else:
        demanded = level
    loop.saturated = 1 if demanded >= law.largest_v else 0
    return float(demanded)


@kernel
def choose_frequency(t: TickArrays, present: bool) -> int:
    """Frequency law: that of the loop, or the plan's; returns the telemetry flag of a loop at its window."""
    law, loop = t.law[0], t.loop[0]
    if loop.drive == WAVEFORM:
        loop.omega = TWO_PI / (t.waveforms.shape[1] * law.dt_s)
    elif loop.drive == TONE:
        loop.omega = t.progress[0].omega
    elif present:
        loop.omega, loop.phase_integral = proportional_integral(
            loop.mean_error if law.period_mean == 1 else loop.error,
            loop.phase_integral,
            law.kp,
            law.ki,
            law.dt_s,
            law.centre_rad_s,
            law.lowest_rad_s,
            law.highest_rad_s,
        )
        if loop.omega == law.lowest_rad_s or loop.omega == law.highest_rad_s:
            return FREQUENCY_CLAMPED
    return 0


@kernel
def oscillate(t: TickArrays, amplitude: float) -> float:
    """The output (V) of this sample, and the oscillator one sample on; a waveform is played by its number of the sample."""
    loop = t.loop[0]
    if loop.drive == WAVEFORM:
        period = t.waveforms.shape[1]
        output = amplitude * t.waveforms[loop.waveform, loop.play]
        loop.play = loop.play + 1 if loop.play + 1 < period else 0
        theta = TWO_PI * loop.play / period
    else:
        output = amplitude * math.cos(loop.theta)
        theta = advance_phase(loop.theta, loop.omega, t.law[0].dt_s)
    if not math.isfinite(output):
        shut_down(t.guard[0], NON_FINITE_OUTPUT, -1, output, loop.sample, True)
        output = 0.0
    sent = t.history[loop.sample % t.history.size]
    sent.theta = loop.theta
    sent.omega = loop.omega
    sent.amplitude_v = amplitude
    sent.output_v = output
    loop.theta = theta
    loop.sample += 1
    return float(output)


@kernel
def tick(t: TickArrays, volts: np.ndarray, readings: np.ndarray, row: Record) -> float:
    """One sample: ``volts`` (float64[n_channels]) in, output voltage out; fills ``readings`` (SI) and the telemetry ``row``."""
    law, loop, guard, progress = t.law[0], t.loop[0], t.guard[0], t.progress[0]
    now = loop.sample
    slot = now % t.history.size
    shown = slot - loop.lead_whole if slot >= loop.lead_whole else slot - loop.lead_whole + t.history.size
    seen = t.history[shown]
    theta_in = phase_on_output(t.history, shown, loop.lead_fraction, law.dt_s)
    row.theta_rad = theta_in
    row.frequency_hz = seen.omega / TWO_PI
    row.output_v = seen.output_v
    row.command_v = seen.amplitude_v

    flags = estimate_inputs(t, volts, readings, math.cos(theta_in), math.sin(theta_in))
    force, drive = t.watches[loop.force_channel].estimate, t.watches[loop.drive_channel].estimate
    size_f, size_a = size(force), size(drive)
    present = size_f >= t.thresholds[0].smallest_force_n and size_a >= t.thresholds[0].smallest_response
    closed = present and loop.drive == LOOP_DRIVE
    loop.error = phase_error(t, force, drive) if closed else 0.0

    if theta_in < loop.theta_in:
        loop.cycles += 1
        close_period(t, present)
    loop.theta_in = theta_in
    loop.sum_error += loop.error
    loop.sum_response += size_a
    loop.sum_force += size_f
    loop.sum_samples += 1

    cycle = loop.cycles + theta_in / TWO_PI
    advance(progress, t.segments, t.outcomes, t.settling[0], t.rule[0], t.lock[0], guard, cycle, now)
    running = guard.mode == ARMED and progress.finished == 0
    loop.held = 0
    if running and progress.entered == 1:
        segment = t.segments[progress.segment]
        loop.held = 1 if segment.kind != RAMP else 0
        loop.drive = segment.drive
        loop.waveform = segment.waveform
    flags |= HELD if loop.held == 1 else 0

    demanded = 0.0
    if running:
        flags |= choose_frequency(t, present)
        if loop.drive != WAVEFORM:
            watch_frequency(guard, t.limits[0], loop.omega, now)
        demanded = demanded_amplitude(t, size_f)
        flags |= SATURATED if loop.saturated == 1 else 0
    amplitude = permitted_amplitude(guard, t.limits[0], demanded, now)
    loop.held_back = 1 if abs(amplitude - demanded) > HELD_BACK * abs(demanded) else 0
    output = oscillate(t, amplitude)

    row.phase_error_rad = loop.error if closed else math.nan
    row.flags = flags
    row.segment = progress.segment if running and progress.segment < progress.segments else -1
    row.lock = t.lock[0].state
    row.guard = guard.mode
    return output


@kernel
def tick_block(
    t: TickArrays,
    volts: np.ndarray,
    flags: np.ndarray,
    readings: np.ndarray,
    rows: np.ndarray,
    outputs: np.ndarray,
) -> None:
    """A block of samples: ``volts`` (float64[n, n_channels]) and the device's ``flags`` (uint16[n]) in, voltages out.

    ``outputs`` (float64[n]) are for the next block.
    """
    for index in range(outputs.size):
        outputs[index] = tick(t, volts[index], readings[index], rows[index])
        rows[index].flags |= np.uint32(flags[index]) << np.uint32(DEVICE_SHIFT)
