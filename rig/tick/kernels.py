"""The compiled tick, shared by all drivers: called per sample, per block, or fused with a virtual rig.

Order within one sample: measure, subtract the mean, demodulate with the phase that was on the output when the reading was
made, lock state, sequencer, frequency law, amplitude law, safety, output, telemetry row.
"""

import math

import numpy as np

from controller.harmonics import drive_harmonics, harmonics_at, measure_harmonics, want_harmonics
from controller.kernels import (
    ADAPTIVE,
    FORCE_RMS,
    LOCKED,
    LOST as LOST_LOCK,
    TWO_PI,
    VOLTAGE,
    add_sample,
    add_to_backbone,
    advance_phase,
    demand,
    detect,
    follow,
    follow_backbone,
    force_rms,
    forget_backbone,
    held_amplitude,
    measure_phase,
    size,
    take_over,
    track_saturation,
)
from rig.daq import LOST
from rig.tick.layout import DEVICE_SHIFT, FREQUENCY_CLAMPED, HELD, SATURATED, TickArrays
from rig.tick.measure import bridge_lost_sample, read_inputs
from rig.tick.periods import close_period
from rig.tick.safety.kernels import permitted_amplitude, permitted_command_phase, release, shut_down, watch_frequency
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.safety.response_plausibility import contradicts_exciter, permitted_level, reset_output, set_reference
from rig.tick.sequencer.kernels import advance, is_ramp
from rig.tick.sequencer.layout import Drive, SegmentKind
from vibrolock.compiled import Record, inner_kernel, kernel

SMALLEST_V = 1e-12  # lower bound of a divisor, against an output of zero
UNREACHED = 0.98  # of the level; chosen: at the voltage limit, a held quantity below it has not reached its level


@kernel
def phase_on_output(history: np.ndarray, seen: int, delay_fraction: float, dt: float) -> float:
    """Return the oscillator phase at the output when this sample's inputs were measured, in [0, 2 pi).

    ``seen`` is the index in the ring of the last whole output sample that affects the inputs.
    """
    before = seen - 1 if seen > 0 else history.size - 1
    theta = history[seen].theta - delay_fraction * dt * history[before].omega
    return float(theta + TWO_PI if theta < 0.0 else theta)


@kernel
def lag_of_channels(loop: Record, omega: float) -> float:
    """Return the phase (rad) by which the force channel lags behind the drive channel: by its delay, and by the high-passes.

    A first-order high-pass of corner w_c leads by atan(w_c / omega); equal corners, as most rigs have, lead by the same.
    """
    leads = 0.0
    if loop.drive_high_pass_rad_s != loop.force_high_pass_rad_s:
        leads = math.atan2(loop.drive_high_pass_rad_s, omega) - math.atan2(loop.force_high_pass_rad_s, omega)
    return float(omega * loop.skew_samples * loop.dt_s + leads)


@inner_kernel
def note_faults(t: TickArrays, flags: int) -> None:
    """Count a sample with a held output, a continued one or a lost one, by the device's ``flags``, in the present segment."""
    loop, progress = t.loop[0], t.progress[0]
    progress.disturbed = 1 if flags & (loop.held_flag | loop.continued_flag | LOST) else 0
    if progress.disturbed == 1:
        progress.held += 1 if flags & loop.held_flag else 0
        progress.continued += 1 if flags & loop.continued_flag else 0
        progress.lost += 1 if flags & LOST else 0


@inner_kernel
def note_put_out(t: TickArrays, voltage: float) -> None:
    """Note that the converter, at this sample, put out ``voltage`` (V) in place of the output that was sent for it."""
    loop = t.loop[0]
    t.history[(loop.sample - loop.queue_whole) % t.history.size].output_v = voltage


@inner_kernel
def tell_continuation(t: TickArrays, continuation: np.ndarray) -> None:
    """Fill ``continuation`` (`rig.daq.CONTINUATION`) for the outputs up to this sample.

    A tone and the loop's output have the oscillator's period; a waveform has its own, but not in the block in which it begins.
    An output of 0 V has none.
    """
    loop, guard, limits = t.loop[0], t.guard[0], t.limits[0]
    played = loop.waveform + 1 if loop.drive == Drive.WAVEFORM else 0
    changes = played != loop.played
    loop.played = played
    told = continuation[0]
    told.period_samples = told.ramp_samples = 0.0
    if changes or guard.amplitude_v == 0.0 or loop.drive == Drive.SILENT:
        return
    omega = t.control[0].frequency.omega
    told.period_samples = t.waveforms.shape[1] if played > 0 else TWO_PI / (omega * loop.dt_s)
    if guard.mode == GuardMode.RAMPING:
        told.ramp_samples = max(guard.ramp_sample + limits.ramp_down_samples - loop.sample, 0.0)


@inner_kernel
def measure_rms(t: TickArrays, amplitude_law: int) -> None:
    """Update the root mean square of the force if ``amplitude_law`` holds it."""
    if amplitude_law == FORCE_RMS:
        control = t.control[0]
        control.vibration.force_rms_n = force_rms(t.law[0].detector, control.detector)


@kernel
def judge_by_exciter(t: TickArrays, seen: Record) -> None:
    """Trip if force and drive contradict, by the known exciter, the output that caused them.

    ``seen`` is the entry of the history with that output.
    """
    loop, guard, plausibility, vibration = t.loop[0], t.guard[0], t.plausibility[0], t.control[0].vibration
    if guard.mode != GuardMode.ARMED or loop.drive in (Drive.WAVEFORM, Drive.SILENT):
        return
    sent = complex(
        seen.amplitude_v * math.cos(seen.command_phase_rad), seen.amplitude_v * math.sin(seen.command_phase_rad)
    )
    gain = t.law[0].detector.gain
    if contradicts_exciter(t.expected[0], plausibility, sent, vibration.force, vibration.drive, gain, loop.dt_s):
        ratio = size(plausibility.needed) / max(size(plausibility.late_sent), SMALLEST_V)
        shut_down(guard, EndReason.PLANT_CONTRADICTED, -1, ratio, loop.sample, False)


@inner_kernel
def note_backbone(t: TickArrays, level: float) -> None:
    """Note the frequency of a ``level`` (V, N or m) held with a lock; forget all levels where there is none any more."""
    control = t.control[0]
    if level > 0.0:
        add_to_backbone(control.backbone, level, t.law[0].frequency.centre_rad_s + control.frequency.integral)
    else:
        forget_backbone(control.backbone)


@kernel
def begin_segment(t: TickArrays, segment: Record) -> None:
    """Switch to the drive and amplitude law of a new segment, starting from the present output and frequency without a jump."""
    loop, control, progress = t.loop[0], t.control[0], t.progress[0]
    amplitude = control.amplitude
    if segment.drive == Drive.LOOP and loop.drive != Drive.LOOP:
        control.frequency.taking_over = 1
    if segment.drive == Drive.TONE and loop.drive == Drive.LOOP:
        progress.omega = control.frequency.omega  # from where the tone's ramp goes to its own frequency
    if loop.drive == Drive.SILENT and segment.drive != Drive.SILENT:
        reset_output(t.plausibility[0])
    loop.drive = segment.drive
    if t.law[0].harmonics.highest > 0:
        want_harmonics(control.harmonics, segment.harmonics)
    if segment.amplitude_law != amplitude.law:
        set_reference(t.expected[0], t.plausibility[0], amplitude.output.amplitude_v, 0.0, 0.0)
        measure_rms(t, segment.amplitude_law)
        progress.level = take_over(t.law[0].amplitude, amplitude, control.vibration, segment.amplitude_law)
        progress.kept_level = 0.0
        forget_backbone(control.backbone)
    if control.backbone.points == 0 and control.lock.state == LOCKED and is_ramp(segment.kind):
        note_backbone(t, progress.level)  # the level of the start


@inner_kernel
def step_sequencer(t: TickArrays) -> bool:
    """Update the plan's level, lag and frequency for this sample; return whether the run goes on."""
    loop, progress, amplitude = t.loop[0], t.progress[0], t.control[0].amplitude
    if progress.entered == 0 and progress.finished == 0 and progress.segment < progress.segments:
        begin_segment(t, t.segments[progress.segment])
    progress.sample = loop.sample
    progress.cycle = loop.cycles + loop.theta_in / TWO_PI
    missed = amplitude.saturated == 1 and held_amplitude(amplitude, t.control[0].vibration) < UNREACHED * progress.level
    progress.unreached = 1 if missed else 0
    kept = progress.kept_level
    advance(progress, t.segments, t.outcomes, t.settling[0], t.rule[0], t.control[0].lock, t.guard[0])
    if progress.kept_level != kept:
        note_backbone(t, progress.kept_level)
    running = t.guard[0].mode == GuardMode.ARMED and progress.finished == 0
    loop.held = 0
    if running and progress.entered == 1:
        segment = t.segments[progress.segment]
        loop.held = 0 if is_ramp(segment.kind) or segment.kind == SegmentKind.RELEASE else 1
        loop.waveform = segment.waveform
    return bool(running)


@inner_kernel
def choose_frequency(t: TickArrays) -> None:
    """Set the frequency of this sample: from the loop (held while no phase can be read) or from the plan."""
    control, loop, progress = t.control[0], t.loop[0], t.progress[0]
    if t.law[0].frequency.feed_forward == 1:
        ramps = loop.drive == Drive.LOOP and loop.held == 0 and progress.returning == 0
        follows = ramps and control.lock.state != LOST_LOCK and control.frequency.clamped == 0
        target = t.segments[progress.segment].level if progress.entered == 1 else progress.level
        follow_backbone(control.backbone, control.frequency, progress.level, target, follows)
    if loop.drive == Drive.WAVEFORM:
        control.frequency.omega = TWO_PI / (t.waveforms.shape[1] * loop.dt_s)
    elif loop.drive == Drive.TONE:
        control.frequency.omega = progress.omega
    elif loop.drive == Drive.LOOP and control.vibration.present == 1:
        follow(t.law[0].frequency, control.frequency, control.vibration, progress.lag)
    if loop.drive != Drive.WAVEFORM:
        watch_frequency(t.guard[0], t.limits[0], control.frequency.omega, loop.sample)


@inner_kernel
def permit_output(t: TickArrays, demanded: float, allowed: float, running: bool) -> float:
    """Apply the safety limits and return the permitted output amplitude (V).

    ``demanded`` is the law's amplitude (V). ``allowed`` is the amplitude after the check that force and motion follow the
    output; the limits apply to it.
    """
    amplitude, guard, limits = t.control[0].amplitude, t.guard[0], t.limits[0]
    if running and t.loop[0].drive == Drive.SILENT:
        release(guard)
    before, phase_rad = guard.amplitude_v, amplitude.output.command_phase_rad
    permitted = permitted_amplitude(guard, limits, allowed, t.loop[0].sample)
    if running:
        phase_rad = permitted_command_phase(limits, phase_rad, amplitude.demanded_phase_rad, before, permitted)
    track_saturation(amplitude, demanded, permitted, phase_rad)
    return permitted


@inner_kernel
def follow_harmonics(t: TickArrays, permitted: float, running: bool) -> None:
    """Evaluate the harmonics loop, if there is one, for the permitted amplitude (V) of the output's fundamental.

    It acts unless the lock is lost, or while the vibration is present at a frequency that the plan gives.
    """
    law, control, loop = t.law[0], t.control[0], t.loop[0]
    if law.harmonics.highest == 0:
        return
    followed = control.lock.state != LOST_LOCK if loop.drive == Drive.LOOP else loop.drive == Drive.TONE
    acts = running and followed and control.vibration.present == 1
    drive_harmonics(law.harmonics, control.harmonics, permitted, control.frequency.omega, running, acts)


@inner_kernel
def with_shaped_rounding(loop: Record, output: float, largest_v: float) -> float:
    """Return the output (V) in whole bits, with the rounding error of the one before; 0 V stays 0 V.

    Error feedback of first order: the error of rounding is differentiated once, so that at a frequency f it is
    ``2 sin(pi f / f_s)`` of what it was (Spang and Schultheiss, 1962, IRE Transactions on Communications Systems 10, 373-380).
    """
    if output == 0.0:
        loop.rounding_v = 0.0
        return 0.0
    bit, wanted = loop.output_bit_v, output + loop.rounding_v
    rounded = bit * math.floor(wanted / bit + 0.5)
    if abs(rounded) > largest_v:
        rounded = math.copysign(bit * math.floor(largest_v / bit), rounded)
    loop.rounding_v = min(max(wanted - rounded, -bit), bit)
    return float(rounded)


@inner_kernel
def oscillate(t: TickArrays, amplitude: float, command_phase_rad: float) -> float:
    """Return the output (V) of this sample, ``Re(U exp(i theta))`` and harmonics, and advance the oscillator by one sample.

    A waveform is read from its table, one entry a sample.
    """
    loop, omega = t.loop[0], t.control[0].frequency.omega
    if loop.drive == Drive.WAVEFORM:
        period = t.waveforms.shape[1]
        output = amplitude * t.waveforms[loop.waveform, loop.play]
        loop.play = loop.play + 1 if loop.play + 1 < period else 0
        theta = TWO_PI * loop.play / period
    else:
        output = amplitude * math.cos(loop.theta + command_phase_rad)
        if t.law[0].harmonics.highest > 0 and loop.drive != Drive.SILENT:
            output += harmonics_at(t.law[0].harmonics, t.control[0].harmonics, loop.theta)
        theta = advance_phase(loop.theta, omega, loop.dt_s)
    if not math.isfinite(output):
        shut_down(t.guard[0], EndReason.NON_FINITE_OUTPUT, -1, output, loop.sample, True)
        output = 0.0
    elif loop.output_bit_v > 0.0 and loop.drive != Drive.WAVEFORM:
        output = with_shaped_rounding(loop, output, t.limits[0].voltage_v)
    sent = t.history[loop.sample % t.history.size]
    sent.theta = loop.theta
    sent.omega = omega
    sent.amplitude_v = amplitude
    sent.command_phase_rad = command_phase_rad
    sent.output_v = output
    loop.theta = theta
    loop.sample += 1
    return float(output)


@kernel
def tick(t: TickArrays, volts: np.ndarray, lost: bool, readings: np.ndarray, row: Record) -> float:
    """Process one sample: take ``volts`` (float64[n_channels]) and return the output voltage.

    Fills ``readings`` (SI) and the telemetry ``row``. If the sample is ``lost``, its volts are ignored: the estimates are held
    except for their ripple, and everything else continues.
    """
    law, control, loop, guard, progress = t.law[0], t.control[0], t.loop[0], t.guard[0], t.progress[0]
    vibration, frequency, amplitude = control.vibration, control.frequency, control.amplitude
    slot = loop.sample % t.history.size
    shown = slot - loop.delay_whole if slot >= loop.delay_whole else slot - loop.delay_whole + t.history.size
    seen = t.history[shown]
    theta_in = phase_on_output(t.history, shown, loop.delay_fraction, loop.dt_s)
    row.theta_rad = theta_in
    row.frequency_hz = seen.omega / TWO_PI
    row.output_v = seen.output_v
    row.command_v = (
        complex(
            seen.amplitude_v * math.cos(seen.command_phase_rad), seen.amplitude_v * math.sin(seen.command_phase_rad)
        )
        if seen.command_phase_rad != 0.0
        else complex(seen.amplitude_v, 0.0)
    )

    cos_theta, sin_theta = math.cos(theta_in), math.sin(theta_in)
    if lost:
        flags = bridge_lost_sample(t, readings, cos_theta, sin_theta)
    else:
        loop.lost = max(loop.lost - 1, 0)  # losses with single good samples in between are a gap as well
        flags = read_inputs(t, volts, readings)
    if not lost or law.detector.kind != ADAPTIVE:
        phasor = complex(cos_theta, sin_theta)
        detect(law.detector, control.detector, vibration, loop.force, loop.drive_motion, phasor, frequency.omega)
        measure_rms(t, amplitude.law)
        if law.harmonics.highest > 0 and not lost:
            channel = loop.drive_channel if law.harmonics.of_drive == 1 else loop.force_channel
            measure_harmonics(law.harmonics, control.harmonics, readings[channel], phasor, frequency.omega)
        if t.expected[0].known == 1:
            judge_by_exciter(t, seen)
    lag = lag_of_channels(loop, frequency.omega)
    closed = measure_phase(law, control, progress.lag, lag, loop.drive == Drive.LOOP)

    if theta_in < loop.theta_in:
        loop.cycles += 1
        close_period(t)
    loop.theta_in = theta_in
    add_sample(control.period, vibration, held_amplitude(amplitude, vibration))

    running = step_sequencer(t)
    demanded = allowed = 0.0
    if running:
        choose_frequency(t)
        by_loop = loop.drive == Drive.LOOP
        demanded = demand(law.amplitude, amplitude, vibration, progress.level, progress.lag, frequency.omega, by_loop)
        allowed = demanded if amplitude.law == VOLTAGE else permitted_level(t.plausibility[0], demanded)
    permitted = permit_output(t, demanded, allowed, running)
    follow_harmonics(t, permitted, running)
    output = oscillate(t, permitted, amplitude.output.command_phase_rad)

    flags |= HELD if loop.held == 1 else 0
    flags |= FREQUENCY_CLAMPED if running and frequency.clamped == 1 else 0
    flags |= SATURATED if running and amplitude.saturated == 1 else 0
    row.phase_error_rad = vibration.error_rad if closed else math.nan
    row.flags = flags
    row.segment = progress.segment if running and progress.segment < progress.segments else -1
    row.lock = control.lock.state
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
    put_out: np.ndarray,
    continuation: np.ndarray,
) -> None:
    """Process a block: take ``volts`` (float64[n, n_channels]), the device's ``flags`` (uint16[n]) and its ``put_out``.

    ``put_out`` (float64[n], V) is what the converter put out in place of an output that was sent, else NaN. Fills
    ``readings``, ``rows``, ``outputs`` (float64[n]), the voltages for the next block, and their ``continuation``
    (`rig.daq.CONTINUATION`).
    """
    for index in range(outputs.size):
        lost = (flags[index] & LOST) != 0
        note_faults(t, flags[index])
        if math.isfinite(put_out[index]):
            note_put_out(t, put_out[index])
        outputs[index] = tick(t, volts[index], lost, readings[index], rows[index])
        rows[index].flags |= np.uint32(flags[index]) << np.uint32(DEVICE_SHIFT)
    if outputs.size > 0:
        tell_continuation(t, continuation)
