"""Compiled reading of the inputs: checks, scaling, means, and substitutes for lost samples."""

import math

import numpy as np

from controller.kernels import TWO_PI, track
from rig.tick.layout import SENSOR_AT_RANGE, TickArrays
from rig.tick.safety.kernels import check_gap, correct_motion, extrapolate_motion, watch_input, watch_motion
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.layout import Drive
from vibrolock.compiled import inner_kernel, kernel

STUCK_SAMPLES = 16
"""Least number of equal readings in a row after which a channel's motion is no longer integrated; see `stuck_after`."""
STUCK_PERIODS = 0.25
"""Periods of equal readings after which it is not; chosen: the displacement is then at most 2.3 times the true one."""

UNCERTAIN_PERIODS = 1.5
"""Periods after a loss, or after equal readings, in which the displacement is corrected; chosen: a difference has then fallen
to 0.1 %."""


@kernel
def examine_input(t: TickArrays, index: int, volts: float, driven: bool) -> tuple[bool, bool]:
    """Check a reading that may be out of order; return whether it may be used, and whether it represents motion.

    A reading beyond its limit trips, and so does a faulty sensor. From then on the channel's displacement is no longer watched:
    integrating the faulty readings, or leaving them out, would feign a displacement.
    """
    guard, limits, loop = t.guard[0], t.limits[0], t.loop[0]
    channel, watch = t.inputs[index], t.watches[index]
    longest = stuck_after(t)
    was_stuck = watch.same_samples >= longest
    usable = watch_input(guard, limits, channel, watch, index, volts, loop.sample, driven)
    within = usable and abs(volts * channel.unit_per_volt) <= channel.limit
    if not within or (guard.channel == index and guard.reason >= EndReason.SENSOR_OVERLOAD):
        watch.distrusted = 1
    stuck = watch.same_samples >= longest
    if was_stuck and not stuck:
        loop.uncertain = uncertain_samples(t)
    return usable, watch.distrusted == 0 and not stuck


@kernel
def stuck_after(t: TickArrays) -> int:
    """Return after how many equal readings a channel's motion is no longer integrated.

    At the turning points of a vibration of A steps of the converter, ``sqrt(2 / A) / pi`` of a period read the same. Leaving
    these readings out would be a drift of the displacement.
    """
    return max(STUCK_SAMPLES, int(STUCK_PERIODS * TWO_PI / (dominant_omega(t) * float(t.loop[0].dt_s))))


@kernel
def uncertain_samples(t: TickArrays) -> int:
    """Return for how many samples the displacement is corrected after a loss."""
    return round(UNCERTAIN_PERIODS * TWO_PI / (dominant_omega(t) * float(t.loop[0].dt_s)))


@inner_kernel
def read_inputs(t: TickArrays, volts: np.ndarray, readings: np.ndarray) -> int:
    """Check and convert every input channel; return the telemetry flags of the inputs."""
    loop, guard, limits = t.loop[0], t.guard[0], t.limits[0]
    armed = guard.mode == GuardMode.ARMED
    driven = armed and (loop.held == 1 or t.progress[0].start_level > 0.0)  # in a ramp from a level, too
    # Start with the mean of all samples so far: noise or ambient vibration in one sample would be integrated to displacement.
    mean_gain = max(t.law[0].detector.mean_gain, 1.0 / (loop.seen + 1.0))
    corrected = loop.uncertain > 0 and mean_gain == t.law[0].detector.mean_gain
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
        if moves:
            watch.mean = track(watch.mean, value, mean_gain)
        value -= watch.mean
        if index == loop.force_channel:
            force = value
        if index == loop.drive_channel:
            drive = value
        if channel.watch_displacement == 1 and moves:
            if corrected:
                correct_motion(limits, watch, value, dominant_omega(t), mean_gain)
            watch_motion(guard, limits, watch, value, index, loop.sample)
    loop.uncertain = max(loop.uncertain - 1, 0)
    loop.force, loop.drive_motion = force, drive
    return flags


@kernel
def dominant_omega(t: TickArrays) -> float:
    """Return the frequency (rad/s) at which the structure mainly vibrates: the oscillator's, or the resonance in a waveform."""
    waveform = t.loop[0].drive == Drive.WAVEFORM
    return float(t.limits[0].resonance_rad_s if waveform else t.control[0].frequency.omega)


@kernel
def bridge_lost_sample(t: TickArrays, readings: np.ndarray, cos_theta: float, sin_theta: float) -> int:
    """Bridge a lost sample: read nothing, extrapolate the motion, and trip if the gap is long.

    The known fundamentals replace force and drive. Thereby the detector's ripple continues; if it were frozen at an arbitrary
    instant, it would become an error of the phase.
    """
    loop, limits, vibration = t.loop[0], t.limits[0], t.control[0].vibration
    dt, mean_gain = loop.dt_s, t.law[0].detector.mean_gain
    readings[:] = math.nan
    loop.lost += 1
    omega = dominant_omega(t)
    loop.uncertain = uncertain_samples(t)
    cos_step, sin_step = math.cos(omega * dt), math.sin(omega * dt)
    for index in range(t.inputs.size):
        if t.inputs[index].watch_displacement == 1:
            watch = t.watches[index]
            # The mean oscillates a little with the vibration; a frozen mean would be integrated to displacement for seconds.
            watch.mean += mean_gain * extrapolate_motion(limits, watch, cos_step, sin_step, omega)
    force, drive = vibration.force, vibration.drive
    loop.force = force.real * cos_theta - force.imag * sin_theta
    t.watches[loop.force_channel].mean += mean_gain * loop.force
    loop.drive_motion = drive.real * cos_theta - drive.imag * sin_theta
    check_gap(t.guard[0], limits, loop.lost, loop.sample, dt)
    return 0
