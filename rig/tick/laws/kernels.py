"""Compiled laws of the tick: phase error, frequency, amplitude, and the change from one law to another without a bump."""

import math

from controller.amplitude.kernels import log_proportional_integral, log_ratio
from controller.demodulation.kernels import phase_lag, root_mean_square
from controller.kernels import TWO_PI, frequency_error, proportional_integral, wrap
from controller.layout import (
    ADAPTIVE,
    FORCE,
    FORCE_RMS,
    FREQUENCY_ERROR,
    LINEAR,
    LOCKED,
    LOGARITHMIC,
    RESPONSE,
    SIGN,
    VOLTAGE,
)
from controller.lock.kernels import next_lock_state
from rig.sequencer.kernels import judge_period
from rig.sequencer.layout import LOOP_DRIVE, TONE, WAVEFORM
from rig.tick.layout import TickArrays
from vibrolock.compiled import Record, kernel

SMALLEST_M = 1e-15  # no displacement is smaller than an atom's nucleus: a floor for logarithms


@kernel
def phase_error(t: TickArrays) -> float:
    """Wanted minus measured phase lag in rad, by the detector of the plan, with the channels' skew taken out."""
    law, loop = t.law[0], t.loop[0]
    skew = t.inputs[loop.force_channel].skew_samples - t.inputs[loop.drive_channel].skew_samples
    lag_of_skew = loop.omega * skew * law.dt_s
    if law.detector == SIGN:
        return float(0.5 * math.pi * loop.sign_mean - lag_of_skew)
    force, drive = t.watches[loop.force_channel].estimate, t.watches[loop.drive_channel].estimate
    return wrap(t.progress[0].lag - phase_lag(force, drive) - lag_of_skew)


@kernel
def controlled_size(t: TickArrays) -> float:
    """What the amplitude loop of the moment holds: a force (N), its RMS (N) or a displacement (m); 0 without a loop."""
    law, loop = t.law[0], t.loop[0]
    if loop.amplitude_law == FORCE:
        return float(loop.force_size)
    if loop.amplitude_law == FORCE_RMS:
        return root_mean_square(t.filters[0]) if law.detector == ADAPTIVE else math.sqrt(loop.force_square)
    return float(loop.displacement) if loop.amplitude_law == RESPONSE else 0.0


@kernel
def add_to_period(t: TickArrays) -> None:
    """Sums for the means of the period under way."""
    loop = t.loop[0]
    loop.sum_error += loop.error
    loop.sum_response += loop.response_size
    loop.sum_force += loop.force_size
    loop.sum_controlled += controlled_size(t)
    loop.sum_samples += 1


@kernel
def close_period(t: TickArrays, present: bool) -> None:
    """An oscillator period has ended at the inputs: lock state and settle rule take its means."""
    loop = t.loop[0]
    n = loop.sum_samples
    if n > 0:
        loop.mean_error = loop.sum_error / n
    if n > 0 and loop.drive != WAVEFORM:
        error = loop.sum_error / n if present else math.nan
        open_loop = loop.drive == TONE
        if not open_loop:
            next_lock_state(t.lock[0], t.thresholds[0], present, loop.held == 1, error)
        locked = (open_loop or t.lock[0].state == LOCKED) and loop.held_back == 0
        judge_period(
            t.settling[0],
            t.rule[0],
            locked,
            error,
            loop.sum_response / n,
            loop.sum_force / n,
            t.progress[0].level if loop.amplitude_law != VOLTAGE else 0.0,
            loop.sum_controlled / n,
            loop.saturated == 1,
            loop.clamped == 1,
            open_loop or loop.amplitude_law == RESPONSE,
        )
    loop.sum_error = 0.0
    loop.sum_response = 0.0
    loop.sum_force = 0.0
    loop.sum_controlled = 0.0
    loop.sum_samples = 0


@kernel
def take_over(t: TickArrays, segment: Record) -> None:
    """A new segment's drive and amplitude law take over: integrals and level begin where the rig is, so that nothing jumps."""
    law, loop, progress = t.law[0], t.loop[0], t.progress[0]
    if segment.drive == LOOP_DRIVE and loop.drive != LOOP_DRIVE:
        loop.taking_over = 1
    if segment.drive == TONE and loop.drive == LOOP_DRIVE:
        progress.omega = loop.omega  # from where the tone's ramp goes to its own frequency
    loop.drive = segment.drive
    if segment.amplitude_law == loop.amplitude_law:
        return
    loop.amplitude_law = segment.amplitude_law
    amplitude = t.guard[0].amplitude_v
    progress.level = amplitude if loop.amplitude_law == VOLTAGE else controlled_size(t)
    loop.force_integral = amplitude
    loop.log_integral = complex(math.log(min(max(amplitude, law.smallest_v), law.largest_v)), loop.turn)
    loop.log_reference = math.log(max(loop.displacement, SMALLEST_M))
    drive = t.watches[loop.drive_channel].estimate
    loop.reference_turn = math.atan2(drive.imag, drive.real)
    loop.response_error = 0.0


@kernel
def hold_response(t: TickArrays, displacement: float) -> None:
    """Response loop: ``ln U = kp E + K int E``, ``E = ln(X_ref/X) + i (phi_0 - arg A_1)``; without ``turns`` the real part."""
    law, loop = t.law[0], t.loop[0]
    turned = 0.0
    if law.turns == 1:
        drive = t.watches[loop.drive_channel].estimate
        turned = wrap(loop.reference_turn - math.atan2(drive.imag, drive.real))
    error = complex(log_ratio(displacement, loop.displacement), turned)
    loop.response_error += law.demodulator_gain * (error - loop.response_error)
    error = loop.response_error
    loop.demanded_v, angle, loop.log_integral = log_proportional_integral(
        error,
        loop.log_integral,
        law.response_kp,
        law.response_ki,
        law.dt_s,
        law.smallest_v,
        law.largest_v,
        loop.behind,
    )
    if law.turns == 1:
        loop.turn = angle


@kernel
def hold_force_through_response(t: TickArrays, level: float) -> None:
    """The part of the force that feeds the vibration sets the response: ``d ln X_ref/dt = k ln(F* sin psi*/(F sin psi))``.

    psi is the lag of the displacement. A tone has no wanted lag: its whole force counts.
    """
    law, loop, progress = t.law[0], t.loop[0], t.progress[0]
    wanted, measured = level, controlled_size(t)
    if loop.drive == LOOP_DRIVE:
        wanted *= abs(math.sin(progress.lag))
        measured *= math.sin(progress.lag - loop.error) * math.copysign(1.0, progress.lag)
    error = log_ratio(wanted, measured)
    if loop.behind >= 0 if error < 0.0 else (loop.saturated == 0 and loop.behind <= 0):
        loop.log_reference += law.reference_ki * law.dt_s * error
    hold_response(t, math.exp(loop.log_reference))


@kernel
def demanded_amplitude(t: TickArrays, present: bool) -> float:
    """Amplitude law: the output amplitude (V) for the level of the moment; kept while response or force cannot be seen."""
    law, loop, level = t.law[0], t.loop[0], t.progress[0].level
    if loop.amplitude_law == VOLTAGE:
        loop.demanded_v = level
    elif loop.amplitude_law == RESPONSE:
        if present:
            hold_response(t, level)
    elif law.force_loop == LINEAR:
        loop.demanded_v, integral = proportional_integral(
            level - controlled_size(t), loop.force_integral, law.k3, law.k4, law.dt_s, 0.0, 0.0, law.largest_v
        )
        if (integral - loop.force_integral) * loop.behind <= 0.0:  # no further the way that the output cannot follow
            loop.force_integral = integral
    elif law.force_loop == LOGARITHMIC:
        loop.demanded_v, _, loop.log_integral = log_proportional_integral(
            complex(log_ratio(level, controlled_size(t)), 0.0),
            loop.log_integral,
            complex(law.force_kp, 0.0),
            law.force_ki,
            law.dt_s,
            law.smallest_v,
            law.largest_v,
            loop.behind,
        )
    elif present:
        hold_force_through_response(t, level)
    loop.saturated = 1 if loop.demanded_v >= law.largest_v else 0
    return float(loop.demanded_v)


@kernel
def choose_frequency(t: TickArrays, present: bool) -> None:
    """Frequency law: that of the loop, or the plan's; notes a loop that stands at an end of its window."""
    law, loop = t.law[0], t.loop[0]
    if loop.drive == WAVEFORM:
        loop.omega = TWO_PI / (t.waveforms.shape[1] * law.dt_s)
    elif loop.drive == TONE:
        loop.omega = t.progress[0].omega
    elif present:
        error = loop.mean_error if law.period_mean == 1 else loop.error
        if law.frequency_law == FREQUENCY_ERROR:
            ratio = law.mode_shape_squared * loop.force_size / loop.response_size
            error = frequency_error(error, ratio, loop.omega, t.progress[0].lag)
        if loop.taking_over == 1:
            loop.taking_over = 0
            loop.phase_integral = loop.omega - law.centre_rad_s - law.kp * error
        loop.omega, loop.phase_integral = proportional_integral(
            error,
            loop.phase_integral,
            law.kp,
            law.ki,
            law.dt_s,
            law.centre_rad_s,
            law.lowest_rad_s,
            law.highest_rad_s,
        )
        loop.clamped = 1 if loop.omega == law.lowest_rad_s or loop.omega == law.highest_rad_s else 0
