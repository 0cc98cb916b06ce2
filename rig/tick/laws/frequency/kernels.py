"""Compiled phase error and frequency law."""

import math

from controller.demodulation.kernels import phase_lag
from controller.kernels import TWO_PI, frequency_error, proportional_integral, size, wrap
from controller.layout import (
    FREQUENCY_ERROR,
    SIGN,
)
from rig.tick.layout import TickArrays
from rig.tick.sequencer.layout import LOOP_DRIVE, TONE, WAVEFORM
from vibrolock.compiled import kernel


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
def see_rest(t: TickArrays) -> None:
    """The force that the vibration of the moment will need once it keeps still: what changes it is taken out.

    A mode whose displacement X grows and turns slowly takes ``phi_d^2 F = (w^2 - W^2 + 2 i z w W) X + 2 i W dX/dt``; its last
    term, by the acceleration's amplitude ``2 i/(W phi_d^2) dA/dt``, is off at rest. Force and motion pass one more low-pass
    for the derivative. Without ``rest_gain`` force and lag are those measured.
    """
    law, loop = t.law[0], t.loop[0]
    force, drive = t.watches[loop.force_channel].estimate, t.watches[loop.drive_channel].estimate
    if law.rest_gain == 0.0 or loop.drive != LOOP_DRIVE:
        loop.late_force, loop.late_drive = force, drive
        loop.rest_force, loop.rest_response, loop.rest_error = loop.force_size, loop.response_size, loop.error
        return
    skew = t.inputs[loop.force_channel].skew_samples - t.inputs[loop.drive_channel].skew_samples
    if skew != 0.0:
        angle = loop.omega * skew * law.dt_s
        drive *= complex(math.cos(angle), math.sin(angle))
    loop.late_force += law.rest_gain * (force - loop.late_force)
    step = law.rest_gain * (drive - loop.late_drive)
    loop.late_drive += step
    rest = loop.late_force + step * complex(
        0.0, 2.0 * law.rest_share / (loop.omega * law.mode_shape_squared * law.dt_s)
    )
    loop.rest_force, loop.rest_response = size(rest), size(loop.late_drive)
    loop.rest_error = wrap(t.progress[0].lag - phase_lag(rest, loop.late_drive))


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
            ratio = law.mode_shape_squared * loop.rest_force / loop.rest_response
            error = frequency_error(loop.rest_error, ratio, loop.omega, t.progress[0].lag)
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
