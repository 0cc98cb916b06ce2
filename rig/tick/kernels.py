"""The compiled tick, once, for every driver: per sample, per block, or fused with a virtual rig.

Order within one sample: measure, take out the mean, demodulate against the phase that was on the output when the
reading was made, lock state, sequencer, frequency law, amplitude law, safety, act, telemetry row.
"""

import math

import numpy as np

from controller.demodulation.kernels import adapt, demodulate, sign_product, turn_phasors
from controller.kernels import TWO_PI, advance_phase, size, track, wrap
from controller.layout import ADAPTIVE, SIGN, VOLTAGE
from rig.daq import LOST
from rig.tick.laws.amplitude.kernels import controlled_size, demanded_amplitude, take_over
from rig.tick.laws.frequency.kernels import choose_frequency, phase_error, see_rest
from rig.tick.laws.periods.kernels import add_to_period, close_period
from rig.tick.layout import DEVICE_SHIFT, FREQUENCY_CLAMPED, HELD, SATURATED, SENSOR_AT_RANGE, TickArrays
from rig.tick.safety.following.kernels import contradicts_exciter, permitted_level
from rig.tick.safety.kernels import (
    NON_FINITE_OUTPUT,
    PLANT_CONTRADICTED,
    SENSOR_OVERLOAD,
    carry_motion,
    permitted_amplitude,
    permitted_turn,
    shut_down,
    watch_frequency,
    watch_gap,
    watch_input,
    watch_motion,
)
from rig.tick.safety.layout import ARMED
from rig.tick.sequencer.kernels import advance, is_ramp
from rig.tick.sequencer.layout import LOOP_DRIVE, WAVEFORM
from vibrolock.compiled import Record, kernel

STUCK_SAMPLES = 16  # equal readings in a row, more than a turning point of a vibration worth watching has
HELD_BACK = 1e-3  # an output further than this part from what the law demands is not at its level
SMALLEST_V = 1e-12  # no division by an output of nothing
UNREACHED = 0.98  # of its level, below which a quantity whose loop stands at the voltage limit has not reached it


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
def take_in(t: TickArrays, volts: np.ndarray, readings: np.ndarray) -> int:
    """Check and convert every input channel; returns the telemetry flags of the inputs."""
    law, loop, guard, limits = t.law[0], t.loop[0], t.guard[0], t.limits[0]
    armed = guard.mode == ARMED
    driven = armed and (loop.held == 1 or t.progress[0].start_level > 0.0)  # in a ramp from a level, too
    # At first the mean of all samples seen so far: noise or ambient vibration in a single one would be integrated as travel.
    mean_gain = max(law.mean_gain, 1.0 / (loop.seen + 1.0))
    loop.seen += 1
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
        if index == loop.force_channel:
            force = value
        if index == loop.drive_channel:
            drive = value
        if channel.watch_displacement == 1 and moves:
            watch_motion(guard, limits, watch, value, index, loop.sample)
    loop.force, loop.drive_motion = force, drive
    return flags


@kernel
def pass_over(t: TickArrays, readings: np.ndarray, cos_theta: float, sin_theta: float) -> int:
    """A sample that was lost on its way: nothing is read, the motion goes on as it was, a long gap trips.

    For force and drive stand the fundamentals as they are known: so a detector's ripple goes on as well, and does not turn
    into an error of the phase by stopping anywhere.
    """
    loop, limits, dt = t.loop[0], t.limits[0], t.law[0].dt_s
    readings[:] = math.nan
    loop.lost += 1
    omega = limits.resonance_rad_s if loop.drive == WAVEFORM else loop.omega
    cos_step, sin_step = math.cos(omega * dt), math.sin(omega * dt)
    for index in range(t.inputs.size):
        if t.inputs[index].watch_displacement == 1:
            watch = t.watches[index]
            # The mean swings a little with the vibration: held anywhere, it would be integrated as travel for seconds.
            watch.mean += t.law[0].mean_gain * carry_motion(limits, watch, cos_step, sin_step, omega)
    force, drive = t.watches[loop.force_channel].estimate, t.watches[loop.drive_channel].estimate
    loop.force = force.real * cos_theta - force.imag * sin_theta
    t.watches[loop.force_channel].mean += t.law[0].mean_gain * loop.force
    loop.drive_motion = drive.real * cos_theta - drive.imag * sin_theta
    watch_gap(t.guard[0], limits, loop.lost, loop.sample, dt)
    return 0


@kernel
def demodulate_inputs(t: TickArrays, cos_theta: float, sin_theta: float) -> None:
    """Force and drive-point motion of this sample into their complex amplitudes and sizes."""
    law, loop, gain = t.law[0], t.loop[0], t.law[0].demodulator_gain
    force, drive = t.watches[loop.force_channel], t.watches[loop.drive_channel]
    if law.detector == ADAPTIVE:
        turn_phasors(t.phasors, cos_theta, sin_theta)
        adapt(t.filters[0], t.phasors, loop.force, gain)
        adapt(t.filters[1], t.phasors, loop.drive_motion, gain)
        force.estimate, drive.estimate = t.filters[0, 1], t.filters[1, 1]
    else:
        force.estimate = demodulate(force.estimate, loop.force, cos_theta, sin_theta, gain)
        drive.estimate = demodulate(drive.estimate, loop.drive_motion, cos_theta, sin_theta, gain)
        loop.force_square = track(loop.force_square, loop.force * loop.force, gain)
        if law.detector == SIGN:
            loop.sign_mean = track(loop.sign_mean, sign_product(loop.force, loop.drive_motion), gain)
    loop.force_size, loop.response_size = size(force.estimate), size(drive.estimate)
    loop.displacement = loop.response_size / (loop.omega * loop.omega)


@kernel
def judge_by_exciter(t: TickArrays, amplitude_v: float, turn: float, sample: int) -> None:
    """Trip where the known exciter contradicts the output (V, rad) that force and drive show at this sample."""
    law, loop, guard, following = t.law[0], t.loop[0], t.guard[0], t.following[0]
    if guard.mode != ARMED or loop.drive == WAVEFORM:
        return
    force, drive = t.watches[loop.force_channel].estimate, t.watches[loop.drive_channel].estimate
    sent = complex(amplitude_v * math.cos(turn), amplitude_v * math.sin(turn))
    if contradicts_exciter(t.expected[0], following, sent, force, drive, law.demodulator_gain, law.dt_s):
        ratio = size(following.needed) / max(size(following.late_sent), SMALLEST_V)
        shut_down(guard, PLANT_CONTRADICTED, -1, ratio, sample, False)


@kernel
def oscillate(t: TickArrays, amplitude: float) -> float:
    """The output (V) of this sample, ``Re(U exp(i theta))``, and the oscillator one sample on.

    A waveform is played by its number of the sample.
    """
    loop = t.loop[0]
    if loop.drive == WAVEFORM:
        period = t.waveforms.shape[1]
        output = amplitude * t.waveforms[loop.waveform, loop.play]
        loop.play = loop.play + 1 if loop.play + 1 < period else 0
        theta = TWO_PI * loop.play / period
    else:
        output = amplitude * math.cos(loop.theta + loop.turn)
        theta = advance_phase(loop.theta, loop.omega, t.law[0].dt_s)
    if not math.isfinite(output):
        shut_down(t.guard[0], NON_FINITE_OUTPUT, -1, output, loop.sample, True)
        output = 0.0
    sent = t.history[loop.sample % t.history.size]
    sent.theta = loop.theta
    sent.omega = loop.omega
    sent.amplitude_v = amplitude
    sent.turn = loop.turn
    sent.output_v = output
    loop.theta = theta
    loop.sample += 1
    return float(output)


@kernel
def tick(t: TickArrays, volts: np.ndarray, lost: bool, readings: np.ndarray, row: Record) -> float:
    """One sample: ``volts`` (float64[n_channels]) in, output voltage out; fills ``readings`` (SI) and the telemetry ``row``.

    Of a sample that is ``lost`` the volts are not looked at: estimates hold, but for their ripple; all else goes on.
    """
    law, loop, guard, progress = t.law[0], t.loop[0], t.guard[0], t.progress[0]
    now = loop.sample
    slot = now % t.history.size
    shown = slot - loop.lead_whole if slot >= loop.lead_whole else slot - loop.lead_whole + t.history.size
    seen = t.history[shown]
    theta_in = phase_on_output(t.history, shown, loop.lead_fraction, law.dt_s)
    row.theta_rad = theta_in
    row.frequency_hz = seen.omega / TWO_PI
    row.output_v = seen.output_v
    row.command_v = (
        complex(seen.amplitude_v * math.cos(seen.turn), seen.amplitude_v * math.sin(seen.turn))
        if seen.turn != 0.0
        else complex(seen.amplitude_v, 0.0)
    )

    cos_theta, sin_theta = math.cos(theta_in), math.sin(theta_in)
    if lost:
        flags = pass_over(t, readings, cos_theta, sin_theta)
    else:
        loop.lost = max(loop.lost - 1, 0)  # losses with single good samples in between are a gap as well
        flags = take_in(t, volts, readings)
    if not lost or law.detector != ADAPTIVE:
        demodulate_inputs(t, cos_theta, sin_theta)
        if t.expected[0].known == 1:
            judge_by_exciter(t, seen.amplitude_v, seen.turn, now)
    thresholds = t.thresholds[0]
    present = loop.force_size >= thresholds.smallest_force_n and loop.response_size >= thresholds.smallest_response
    closed = present and loop.drive == LOOP_DRIVE
    loop.error = phase_error(t) if closed else 0.0
    see_rest(t)

    if theta_in < loop.theta_in:
        loop.cycles += 1
        close_period(t, present)
    loop.theta_in = theta_in
    add_to_period(t)

    if progress.entered == 0 and progress.finished == 0 and progress.segment < progress.segments:
        take_over(t, t.segments[progress.segment])
    cycle = loop.cycles + theta_in / TWO_PI
    unreached = loop.saturated == 1 and controlled_size(t) < UNREACHED * progress.level
    advance(progress, t.segments, t.outcomes, t.settling[0], t.rule[0], t.lock[0], guard, cycle, now, unreached)
    running = guard.mode == ARMED and progress.finished == 0
    loop.held = 0
    if running and progress.entered == 1:
        segment = t.segments[progress.segment]
        loop.held = 0 if is_ramp(segment.kind) else 1
        loop.waveform = segment.waveform
    flags |= HELD if loop.held == 1 else 0

    demanded = allowed = 0.0
    if running:
        choose_frequency(t, present)
        flags |= FREQUENCY_CLAMPED if loop.clamped == 1 else 0
        if loop.drive != WAVEFORM:
            watch_frequency(guard, t.limits[0], loop.omega, now)
        demanded = demanded_amplitude(t, present)
        allowed = demanded if loop.amplitude_law == VOLTAGE else permitted_level(t.following[0], demanded)
        flags |= SATURATED if loop.saturated == 1 else 0
    before, loop.turn_behind = guard.amplitude_v, 0
    amplitude = permitted_amplitude(guard, t.limits[0], allowed, now)
    if running and loop.demanded_turn != loop.turn:
        loop.turn = permitted_turn(t.limits[0], loop.turn, loop.demanded_turn, before, amplitude)
        if loop.turn != loop.demanded_turn:
            loop.turn_behind = 1 if wrap(loop.demanded_turn - loop.turn) > 0.0 else -1
    loop.held_back = 1 if abs(amplitude - demanded) > HELD_BACK * abs(demanded) else 0
    loop.behind = 0 if loop.held_back == 0 else (1 if demanded > amplitude else -1)
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
        lost = (flags[index] & LOST) != 0
        outputs[index] = tick(t, volts[index], lost, readings[index], rows[index])
        rows[index].flags |= np.uint32(flags[index]) << np.uint32(DEVICE_SHIFT)
