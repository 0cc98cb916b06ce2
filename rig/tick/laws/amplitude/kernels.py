"""Compiled amplitude laws: what is held, how, and how one law takes over from another without a bump."""

import math

from controller.amplitude.kernels import log_proportional_integral, log_ratio
from controller.demodulation.kernels import root_mean_square
from controller.kernels import proportional_integral, size, wrap
from controller.layout import (
    ADAPTIVE,
    FORCE,
    FORCE_RMS,
    LINEAR,
    LOGARITHMIC,
    RESPONSE,
    VOLTAGE,
)
from rig.tick.layout import TickArrays
from rig.tick.safety.following.kernels import begin_to_follow
from rig.tick.sequencer.layout import LOOP_DRIVE, TONE
from vibrolock.compiled import Record, kernel

SLOPE_FORGETS = 0.5  # rate at which a slope is forgotten, over that of the loop it is for
STEEPEST = 10.0
UNMOVED = 1e-7  # square of a logarithm's change (0.03 %) below which a slope is not believed
PLANT_VARIES = 3.0  # factor that the plant's gain may be off and is still followed
SMALLEST_M = 1e-15  # no displacement is smaller than an atom's nucleus: a floor for logarithms


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
    loop.demanded_turn = loop.turn
    loop.turn_behind = 0
    amplitude = t.guard[0].amplitude_v
    begin_to_follow(t.expected[0], t.following[0], amplitude, 0.0, 0.0)
    progress.level = amplitude if loop.amplitude_law == VOLTAGE else controlled_size(t)
    loop.force_integral = amplitude
    loop.log_integral = complex(math.log(min(max(amplitude, law.smallest_v), law.largest_v)), loop.turn)
    loop.log_reference = math.log(max(loop.displacement, SMALLEST_M))
    drive = t.watches[loop.drive_channel].estimate
    loop.reference_turn = math.atan2(drive.imag, drive.real)
    loop.response_error = 0.0
    loop.slope_known = 0
    loop.plant_ratio = 1.0


@kernel
def response_proportional(t: TickArrays) -> complex:
    """The response loop's kp, following the plant: ``kp (A/U)/G``, G what A/U was where kp was right.

    A softening structure moves the plant's pole p, while the residue of ``A/U = R/(i W - p)`` is the shaker's: -p goes
    with U/A. Within a factor; without G the gain stays.
    """
    law, loop = t.law[0], t.loop[0]
    if law.plant_gain == 0.0:
        return complex(law.response_kp)
    drive, amplitude = t.watches[loop.drive_channel].estimate, t.guard[0].amplitude_v
    if amplitude > 0.0:
        now = drive * complex(math.cos(loop.turn), -math.sin(loop.turn)) / amplitude / law.plant_gain
        loop.plant_ratio += 0.25 * law.response_ki * law.dt_s * (now - loop.plant_ratio)
    ratio = size(loop.plant_ratio)
    bounded = min(max(ratio, 1.0 / PLANT_VARIES), PLANT_VARIES) / ratio if ratio > 0.0 else 0.0
    return complex(law.response_kp * loop.plant_ratio * bounded)


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
    before = loop.log_integral.imag
    loop.demanded_v, angle, integral = log_proportional_integral(
        error,
        loop.log_integral,
        response_proportional(t),
        law.response_ki,
        law.dt_s,
        law.smallest_v,
        law.largest_v,
        loop.behind,
    )
    if (integral.imag - before) * loop.turn_behind > 0.0:  # no further the way that the output cannot turn
        angle -= integral.imag - before
        integral = complex(integral.real, before)
    loop.log_integral = integral
    if law.turns == 1:
        loop.demanded_turn = angle


@kernel
def force_at_lag(t: TickArrays) -> float:
    """What the amplitude loop holds (N), as it would be at the wanted lag and at rest, if the response stayed as it is.

    The part of the fundamental that feeds the vibration stays, ``F sin psi`` with the lag psi of the displacement,
    and so do the harmonics. It may be negative where the force brakes. A tone has no wanted lag: the force as it is.
    """
    loop, lag = t.loop[0], t.progress[0].lag
    measured = controlled_size(t)
    if loop.drive != LOOP_DRIVE:
        return measured
    # lag is that of the acceleration, whose sine is minus that of the displacement's: the ratio is the same
    fundamental = loop.rest_force * math.sin(lag - loop.rest_error) / math.sin(lag)
    if loop.amplitude_law != FORCE_RMS:
        return float(fundamental)
    above = max(measured * measured - 0.5 * loop.force_size * loop.force_size, 0.0)
    return math.copysign(math.sqrt(above + 0.5 * fundamental * fundamental), fundamental)


@kernel
def force_slope(t: TickArrays) -> float:
    """``d ln(F sin psi)/d ln X`` as it was of late, by least squares with forgetting, within bounds; 1 where nothing moved.

    Where friction begins to slide it is 5 and more: the loop through the response would have so many times its gain.
    """
    law, loop = t.law[0], t.loop[0]
    active = loop.rest_force * abs(math.sin(t.progress[0].lag - loop.rest_error))
    if law.rest_gain == 0.0 or loop.drive != LOOP_DRIVE or not active > 0.0:
        return 1.0
    x, f = math.log(loop.rest_response / (loop.omega * loop.omega)), math.log(active)
    if loop.slope_known == 0:
        loop.slope_known = 1
        loop.slow_x, loop.slow_f, loop.square_x, loop.product_xf = x, f, 0.0, 0.0
    gain = law.reference_ki * law.dt_s
    loop.slow_x += gain * (x - loop.slow_x)
    loop.slow_f += gain * (f - loop.slow_f)
    x, f = x - loop.slow_x, f - loop.slow_f
    loop.square_x += SLOPE_FORGETS * gain * (x * x - loop.square_x)
    loop.product_xf += SLOPE_FORGETS * gain * (x * f - loop.product_xf)
    slope = (loop.product_xf + UNMOVED) / (loop.square_x + UNMOVED)
    return float(min(max(slope, 1.0), STEEPEST))


@kernel
def hold_force_through_response(t: TickArrays, level: float) -> None:
    """The part of the force that feeds the vibration sets the response: ``d ln X_ref/dt = (k/s) ln(F* sin psi*/(F sin psi))``.

    s is its slope over the response (`force_slope`).
    """
    law, loop = t.law[0], t.loop[0]
    error = log_ratio(level, force_at_lag(t)) / force_slope(t)
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
