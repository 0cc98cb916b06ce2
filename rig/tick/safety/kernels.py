"""Compiled safety decisions: pure functions of readings, limits and the guard's own state."""

import math

from controller.kernels import wrap
from rig.bench.cross_checks import OVERTRAVEL_FACTOR
from rig.tick.safety.layout import EndReason, GuardMode
from vibrolock.compiled import Record, kernel

FORCE = 0  # `rig.daq.Role.FORCE`


@kernel
def shut_down(guard: Record, reason: int, channel: int, value: float, sample: int, drop: bool) -> None:
    """Begin the ramp to 0 V, or drop at once. The first cause is kept; a later one may only turn a ramp into a drop."""
    if guard.mode == GuardMode.ARMED or guard.mode == GuardMode.DISARMED:
        guard.reason = reason
        guard.channel = channel
        guard.value = value
        guard.sample = sample
        guard.ramp_sample = sample
        guard.ramp_from_v = guard.amplitude_v
        guard.mode = GuardMode.RAMPING
    if drop:
        guard.amplitude_v = 0.0
        guard.mode = GuardMode.OFF
        guard.dropped = 1


@kernel
def is_over(guard: Record, lead: int) -> bool:
    """Return whether the output was dropped, or was ramped down and the ramp's last sample has left the device's queue."""
    return bool(guard.mode == GuardMode.OFF and (guard.dropped == 1 or guard.off_samples > lead))


@kernel
def watch_switch(guard: Record, channel: Record, index: int, volts: float, sample: int) -> None:
    """Drop to 0 V if the emergency stop is pressed or its reading is not a number; a constant reading is allowed."""
    if not channel.stop_below_v <= volts <= channel.stop_above_v:
        shut_down(guard, EndReason.EMERGENCY_STOP, index, volts * channel.unit_per_volt, sample, True)


@kernel
def watch_input(
    guard: Record, limits: Record, channel: Record, watch: Record, index: int, volts: float, sample: int, driven: bool
) -> bool:
    """Check one raw reading (V) before it is used; return False if it is not a finite number and must not be used."""
    if channel.emergency_stop == 1:
        watch_switch(guard, channel, index, volts, sample)
        return math.isfinite(volts)
    if not math.isfinite(volts):
        shut_down(guard, EndReason.NON_FINITE_INPUT, index, volts, sample, False)
        return False
    watch.overload_samples = watch.overload_samples + 1 if abs(volts) >= channel.overload_v else 0
    if watch.overload_samples >= limits.overload_samples:
        shut_down(guard, EndReason.SENSOR_OVERLOAD, index, volts * channel.unit_per_volt, sample, False)
    watch.same_samples = watch.same_samples + 1 if driven and volts == watch.last_v else 0
    watch.last_v = volts
    watch.alert = 1 if watch.same_samples > 0 or watch.overload_samples > 0 else 0
    if watch.same_samples >= limits.stuck_samples:
        shut_down(guard, EndReason.SENSOR_STUCK, index, volts * channel.unit_per_volt, sample, False)
    watch_limit(guard, channel, index, volts * channel.unit_per_volt, sample)
    return True


@kernel
def watch_limit(guard: Record, channel: Record, index: int, value: float, sample: int) -> None:
    """Check a force or acceleration: trip beyond its limit; drop the output if it grows far beyond during a trip's ramp."""
    if abs(value) > channel.near:
        guard.near = 1
    if abs(value) > channel.limit:
        reason = EndReason.FORCE_LIMIT if channel.role == FORCE else EndReason.RESPONSE_LIMIT
        if guard.mode == GuardMode.ARMED:
            shut_down(guard, reason, index, value, sample, False)
        elif (
            guard.mode == GuardMode.RAMPING
            and guard.reason >= EndReason.FORCE_LIMIT
            and abs(value) > OVERTRAVEL_FACTOR * channel.limit
        ):
            shut_down(guard, reason, index, value, sample, True)


@kernel
def watch_motion(guard: Record, limits: Record, watch: Record, acceleration: float, index: int, sample: int) -> None:
    """Integrate an acceleration (m/s^2) twice, with a leak that removes offsets, and check the displacement (m)."""
    gain, keep = limits.integrator_gain, 1.0 - limits.integrator_leak
    velocity = keep * watch.velocity + gain * acceleration
    displacement = keep * watch.displacement + gain * velocity
    watch.velocity = velocity
    watch.displacement = displacement
    travel_m = abs(displacement)
    if travel_m > OVERTRAVEL_FACTOR * limits.displacement_m:
        shut_down(guard, EndReason.OVERTRAVEL, index, travel_m, sample, True)
    elif travel_m > limits.displacement_m:
        shut_down(guard, EndReason.DISPLACEMENT_LIMIT, index, travel_m, sample, False)
    elif travel_m > limits.near_m:
        guard.near = 1


@kernel
def extrapolate_motion(limits: Record, watch: Record, cos_step: float, sin_step: float, omega: float) -> float:
    """Extrapolate the motion over one lost sample, as a harmonic vibration at ``omega`` (rad/s).

    Integrating an acceleration with a gap would leave a velocity offset and feign a displacement. With the leak l (1/s),
    ``x' = v - l x``. From ``x'' = -w^2 x`` follows ``v' = l v - (w^2 + l^2) x``, a rotation by w dt for any l. Return the
    corresponding acceleration (m/s^2), ``v' + l v``.
    """
    leak = limits.integrator_leak / limits.integrator_gain
    velocity, displacement = watch.velocity, watch.displacement
    share = sin_step / omega
    watch.velocity = cos_step * velocity + share * (leak * velocity - (omega * omega + leak * leak) * displacement)
    watch.displacement = cos_step * displacement + share * (velocity - leak * displacement)
    return float(2.0 * leak * velocity - (omega * omega + leak * leak) * displacement)


@kernel
def correct_motion(limits: Record, watch: Record, acceleration: float, omega: float, mean_gain: float) -> None:
    """Draw velocity and displacement towards the harmonic vibration at ``omega`` (rad/s) that an acceleration (m/s^2) shows.

    After a loss the vibration may go on with another phase than was extrapolated: the device has put out something else, or
    has lost more than it said. Integration alone would keep the difference of velocity for seconds, for the leak is small. A
    Luenberger observer forgets it within a period. It compares the acceleration with that of `extrapolate_motion`, and its
    poles are ``-w (1 +- j) / sqrt(2)``. A harmonic vibration at ``w`` is left as it is. The channel's mean follows a vibration
    by ``mean_gain / dt`` times its velocity.
    """
    dt = limits.integrator_gain
    leak = limits.integrator_leak / dt
    expected = 2.0 * leak * watch.velocity - (omega * omega + leak * leak) * watch.displacement
    step = dt * (expected - acceleration)
    watch.velocity += step
    watch.displacement += math.sqrt(2.0) / omega * step
    watch.mean += mean_gain / dt * step


@kernel
def check_gap(guard: Record, limits: Record, lost: int, sample: int, dt_s: float) -> None:
    """Trip if the count of lost samples, minus those received since, reaches its limit."""
    if lost >= limits.lost_samples:
        shut_down(guard, EndReason.SAMPLES_LOST, -1, lost * dt_s, sample, False)


@kernel
def watch_frequency(guard: Record, limits: Record, omega: float, sample: int) -> None:
    """Trip if the frequency (rad/s) of the output is outside its limits."""
    if guard.mode == GuardMode.ARMED and (omega < limits.lowest_rad_s or omega > limits.highest_rad_s):
        shut_down(guard, EndReason.FREQUENCY_LIMIT, -1, omega / (2.0 * math.pi), sample, False)


@kernel
def release(guard: Record) -> None:
    """Take the output to 0 V at once, without the slew limit, so that the vibration decays freely.

    The guard stays armed: its limits go on, and what trips finds the output at 0 V already. Only the sequencer calls this, in a
    segment of kind ``RELEASE``; whatever ends a run is `shut_down`.
    """
    if guard.mode == GuardMode.ARMED:
        guard.amplitude_v = 0.0


@kernel
def permitted_command_phase(
    limits: Record, phase_rad: float, demanded: float, before_v: float, after_v: float
) -> float:
    """Return the next angle (rad) of the complex command after ``phase_rad``; its size goes from ``before_v`` to ``after_v``.

    The command's total change keeps the slew limit s: ``|dU|^2 = da^2 + 4 a_0 a_1 sin^2(d/2) <= da^2 + a_0 a_1 d^2 <= s^2``.
    The amplitude has priority; the angle's change d uses the remainder and takes the shorter way round.
    """
    product = before_v * after_v
    if demanded == phase_rad or not product > 0.0:
        return demanded
    change = after_v - before_v
    left = max(limits.slew_v_per_sample * limits.slew_v_per_sample - change * change, 0.0)
    change_rad = wrap(demanded - phase_rad)
    if change_rad * change_rad * product <= left:
        return demanded
    return float(phase_rad + math.copysign(math.sqrt(left / product), change_rad))


@kernel
def permitted_amplitude(guard: Record, limits: Record, demanded_v: float, sample: int) -> float:
    """Return the permitted output amplitude (V) for the law's ``demanded_v``: clamped, slew-limited, ramped down or zero."""
    if not math.isfinite(demanded_v):
        shut_down(guard, EndReason.NON_FINITE_OUTPUT, -1, demanded_v, sample, True)
    if guard.mode == GuardMode.ARMED:
        target = min(max(demanded_v, -limits.voltage_v), limits.voltage_v)
        step = min(max(target - guard.amplitude_v, -limits.slew_v_per_sample), limits.slew_v_per_sample)
        guard.amplitude_v += step
    elif guard.mode == GuardMode.RAMPING:
        done = (sample - guard.ramp_sample) / limits.ramp_down_samples
        if done >= 1.0:
            guard.amplitude_v = 0.0
            guard.mode = GuardMode.OFF
        else:
            guard.amplitude_v = guard.ramp_from_v * 0.5 * (1.0 + math.cos(math.pi * done))
    else:
        guard.amplitude_v = 0.0
    if guard.mode == GuardMode.OFF:
        guard.off_samples += 1
    return float(guard.amplitude_v)
