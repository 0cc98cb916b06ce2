"""Compiled plausibility check of the response: whether force and motion follow the output.

There are two checks. A linear exciter obeys ``u = alpha(s) F + beta(s) A`` whatever the structure does. If alpha and beta are
known, the fundamentals of every sample are compared with this equation (`contradicts_exciter`). In any case the output that
last sufficed serves as reference: a law that holds a force or a response may not raise its output beyond `LARGEST_RISE` times
this reference while the held quantity does not follow (`check_held_level`).
"""

import math

import numpy as np

from controller.kernels import RESPONSE, TWO_PI, size
from rig.tick.safety.keeping import FAR, KEPT
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel

LARGEST_RISE = 2.0  # largest output over the output that last sufficed; this also bounds the rise within one period
CREEP = 1.05  # a period: largest rise of the reference output while the held quantity stays at its level
OUT_OF_BAND_RISE = 1.5  # rise of the output from which a held quantity that does not follow counts as astray
OUT_OF_BAND_PART = 0.5  # of its reference; a held quantity below it is astray from a rise of RISEN on
OUT_OF_BAND_PERIODS = 10  # that trip; chosen: a vibration that builds up recovers earlier
RISEN = 1.2  # rise from which the output counts as risen; a force that sags during build-up needs no more output
IN_ORDER = 0.9  # of its level; a held quantity above it follows
SAGGED = 0.75  # of its level; a force may sag to it while the vibration builds up
TOO_MUCH = 1.5  # times its level; a law that raises its output above it does not hold the quantity that it reads
GROWN = 1.1  # times its reference; a quantity that has grown so much follows, even if far from its level
JUMPED = 1.3  # growth of vibration over rise of output from which a force may fall: a jump past a turning point
VANISHED = 0.15  # of its level; a jump past a turning point leaves more force than this
VISIBLE = 8.0  # times the smallest amplitude whose phase can be read: about three bits of the converter
SILENT_PERIODS = 40  # that trip; chosen
UNLIKE = 0.6  # deviation of sent from needed output, over the largest of the output and the terms of the exciter
TOO_STRONG = 4.0  # needed over sent output; shows an amplifier of another gain, even while the vibration grows
WIDE = 3.0  # times its band; within it the known exciter can still show an amplifier of another gain
DOUBTED = 3.0  # standard errors of the exciter that are left to it
UNLIKE_PERIODS = 1.0  # duration of a contradiction that trips, in periods at the centre frequency of the known exciter

EXPECTED = record(
    ("force_v_n", "f8", (4,)),
    ("acceleration_v_s2_m", "f8", (4,)),
    ("mode", "f8", (3,)),
    ("residual_per_kg", "f8", (2,)),
    i8="known",
    f8="centre_rad_s force_v_n_std lowest_rad_s highest_rad_s noise_n noise_m_s2 visible_n visible_m_s2 floor_v "
    "force_skew_s drive_skew_s checked_n_v checked_m_s2_v",
)
"""Knowledge before the run (one record).

``known``: whether the exciter ``u = alpha F + beta A`` is known; its coefficients are as in `controller.tuning.PlantModel`, and
``lowest_rad_s``, ``highest_rad_s`` are the band in which they hold. ``force_v_n_std``: standard error of alpha; ``mode``
(frequency in rad/s, damping ratio, squared mode shape) and ``residual_per_kg``: the structure's accelerance. ``noise_``:
amplitudes below which the exciter is not judged. ``visible_``: amplitudes above which a force or acceleration is distinguished
from noise. ``floor_v``: output that is always allowed. ``_skew_s``: delays of the two channels. ``checked_``: force (N) and
motion (m/s^2) per volt at resonance in the last check, 0 if unknown."""

PLAUSIBILITY = record(
    ("kept", KEPT),
    c16="alpha beta alpha_rate beta_rate force_doubt drive_doubt sent late_sent late_force late_drive needed",
    i8="told silent_periods out_of_band_periods most_periods",
    f8="unlike_s most_unlike_s reference_v reference_level reference_other largest_rise",
)
"""State of the supervision (one record).

``alpha``, ``beta``: exciter at this period's frequency; ``_rate``: their derivatives by s; ``told``: whether alpha and beta are
individually known at this frequency. ``force_doubt``, ``drive_doubt``: standard error of the output that the exciter needs, per
force and per motion. ``sent``: complex output after the detector's low-pass; ``late_``: quantities after the
same low-pass once more; ``needed``: output that the known exciter needs for force and motion. ``unlike_s``: present
uninterrupted time in which ``late_sent`` and ``needed`` contradict each other; ``most_unlike_s``: the longest such time.
``silent_periods``: periods in a row in which either force or motion showed nothing while the other was large. ``reference_``:
output (V), held quantity, and the other of force and motion, when the held quantity last followed. ``out_of_band_periods``:
count of periods since then in which the held quantity did not follow; ``most_periods``: the highest count so far;
``largest_rise``: the largest ratio of output to reference output in these periods. ``kept``: state of
`rig.tick.safety.keeping`."""


@kernel
def polynomial(coefficients: np.ndarray, z: complex) -> tuple[complex, complex]:
    """Return ``c_0 + c_1 z + c_2 z^2 + c_3 z^3`` and its derivative."""
    c0, c1, c2, c3 = coefficients[0], coefficients[1], coefficients[2], coefficients[3]
    return complex(c0 + z * (c1 + z * (c2 + z * c3))), complex(c1 + z * (2.0 * c2 + z * 3.0 * c3))


@kernel
def evaluate_exciter(expected: Record, plausibility: Record, omega: float) -> None:
    """Evaluate the known exciter at the present frequency (rad/s), once a period; set it to zero outside its range.

    Alpha and beta are individually known (``told``) within the exciter's band. Within `WIDE` times the band they can still show
    an amplifier of another gain. ``alpha``, ``beta`` and their derivatives by s come from polynomials in ``z = s/centre``; the
    polynomial of beta is divided by z^2.
    """
    plausibility.alpha = plausibility.beta = plausibility.alpha_rate = plausibility.beta_rate = 0.0
    plausibility.force_doubt = plausibility.drive_doubt = 0.0
    plausibility.told = 1 if expected.lowest_rad_s <= omega <= expected.highest_rad_s else 0
    middle, half = (
        0.5 * (expected.lowest_rad_s + expected.highest_rad_s),
        0.5 * (expected.highest_rad_s - expected.lowest_rad_s),
    )
    if expected.known == 0 or abs(omega - middle) > WIDE * half:
        return
    z = complex(0.0, omega / expected.centre_rad_s)
    force_turn, drive_turn = omega * expected.force_skew_s, omega * expected.drive_skew_s
    of_force = complex(math.cos(force_turn), math.sin(force_turn))
    of_drive = complex(math.cos(drive_turn), math.sin(drive_turn))
    alpha, alpha_slope = polynomial(expected.force_v_n, z)
    beta, beta_slope = polynomial(expected.acceleration_v_s2_m, z)
    plausibility.alpha = alpha * of_force
    plausibility.beta = beta / (z * z) * of_drive
    plausibility.alpha_rate = alpha_slope / expected.centre_rad_s * of_force
    plausibility.beta_rate = (beta_slope - 2.0 * beta / z) / (z * z) / expected.centre_rad_s * of_drive
    plausibility.force_doubt = expected.force_v_n_std * of_force
    plausibility.drive_doubt = expected.force_v_n_std * of_drive / accelerance(expected, omega)


@kernel
def accelerance(expected: Record, omega: float) -> complex:
    """Return the accelerance (1/kg) of the linear structure at a frequency (rad/s), as `controller.tuning.PlantModel` does."""
    s, z = complex(0.0, omega), complex(0.0, omega / expected.centre_rad_s)
    frequency, damping, shape_squared = expected.mode[0], expected.mode[1], expected.mode[2]
    mode = shape_squared * s * s / (s * s + 2.0 * damping * frequency * s + frequency * frequency)
    return complex(mode + expected.residual_per_kg[0] + expected.residual_per_kg[1] * z * z)


@kernel
def contradicts_exciter(
    expected: Record, plausibility: Record, sent: complex, force: complex, drive: complex, gain: float, dt_s: float
) -> bool:
    """Return whether force and motion have contradicted the output, by the known exciter, for `UNLIKE_PERIODS`; once a sample.

    ``sent`` is the complex output (V) whose effect ``force`` (N) and ``drive`` (m/s^2) show. ``sent`` passes the detector's
    low-pass of step ``gain``. Then all three pass one more low-pass, which gives the derivatives for changing amplitudes:
    ``U = alpha F + alpha' dF/dt + beta A + beta' dA/dt``. Amplitudes below the noise are not judged.

    A linear test measures ``alpha + beta Y``, so that ``alpha + x`` with ``beta - x/Y`` fits as well. The output is compared
    with all these exciters, for x up to `DOUBTED` standard errors of alpha: what was not identified contradicts nothing. On the
    linear structure, where ``A = Y F``, they all need the same output.
    """
    plausibility.sent += gain * (sent - plausibility.sent)
    plausibility.late_sent += gain * (plausibility.sent - plausibility.late_sent)
    force_step, drive_step = gain * (force - plausibility.late_force), gain * (drive - plausibility.late_drive)
    plausibility.late_force += force_step
    plausibility.late_drive += drive_step
    for_force, for_motion = plausibility.alpha * plausibility.late_force, plausibility.beta * plausibility.late_drive
    for_change = (plausibility.alpha_rate * force_step + plausibility.beta_rate * drive_step) / dt_s
    plausibility.needed = for_force + for_motion + for_change
    most = max(size(plausibility.late_sent), size(for_force), size(for_motion), size(for_change))
    noise = size(plausibility.alpha) * expected.noise_n + size(plausibility.beta) * expected.noise_m_s2
    doubt = DOUBTED * size(
        plausibility.drive_doubt * plausibility.late_drive - plausibility.force_doubt * plausibility.late_force
    )
    too_strong = size(plausibility.needed) - doubt > max(TOO_STRONG * size(plausibility.late_sent), noise)
    apart = size(plausibility.late_sent - plausibility.needed) - doubt
    unlike = plausibility.told == 1 and most > noise and apart > UNLIKE * most
    unlike = noise > 0.0 and (unlike or too_strong)
    plausibility.unlike_s = plausibility.unlike_s + dt_s if unlike else 0.0
    plausibility.most_unlike_s = max(plausibility.most_unlike_s, plausibility.unlike_s)
    return bool(plausibility.unlike_s > UNLIKE_PERIODS * TWO_PI / expected.centre_rad_s)


@kernel
def silent_side(expected: Record, plausibility: Record, force: float, response: float) -> int:
    """Return 1 if the force (N), 2 if the motion (m/s^2) has shown nothing for `SILENT_PERIODS`, else 0.

    Called once a period while no lock was ever gained. The other signal must be clearly visible, because a level may be too
    low for both.
    """
    no_force = force < expected.visible_n / VISIBLE and response > VISIBLE * expected.visible_m_s2
    no_motion = response < expected.visible_m_s2 / VISIBLE and force > VISIBLE * expected.visible_n
    plausibility.silent_periods = plausibility.silent_periods + 1 if no_force or no_motion else 0
    return 0 if plausibility.silent_periods < SILENT_PERIODS else 1 if no_force else 2


@kernel
def set_reference(expected: Record, plausibility: Record, amplitude_v: float, level: float, other: float) -> None:
    """Take the present output (V), held quantity and other quantity as the reference of the supervision."""
    plausibility.reference_v = max(amplitude_v, expected.floor_v)
    plausibility.reference_level = level
    plausibility.reference_other = other
    plausibility.out_of_band_periods = 0


@kernel
def check_held_level(
    expected: Record,
    plausibility: Record,
    period: Record,
    wanted: float,
    law: int,
    slipping: bool,
    may_jump: bool,
) -> bool:
    """Check once a period whether the held quantity follows the output; return whether it was astray for `OUT_OF_BAND_PERIODS`.

    ``period`` (of `controller.period.PERIOD`) gives the output, the fundamentals and the held quantity, which should be
    ``wanted`` (N or m). The reference is the last state in which the held quantity followed. ``slipping``: the lock is about to
    be lost; the reference is then not updated.

    The held quantity follows if it has moved towards its level since the reference, or if it is near its level and the output
    rises only slowly. It is astray

    - if the output has risen and the quantity has not followed,
    - if the quantity has fallen to half its reference, or
    - if it is too large.

    A held force has three exceptions. It may be too large while the vibration builds up. It may drop by up to a quarter while
    the output rises slowly, if the vibration has grown more than the output. At a frequency given by the plan (``may_jump``) it
    may then drop further, because a structure can jump past a turning point.
    """
    amplitude_v, held, force, response = period.output_v, period.held, period.force_n, period.drive_m_s2
    smallest = expected.visible_m_s2 if law == RESPONSE else min(expected.visible_n, IN_ORDER * wanted)
    other = force if law == RESPONSE else response
    visible = (response if law == RESPONSE else force) >= smallest
    rise = amplitude_v / plausibility.reference_v
    too_much = held > TOO_MUCH * wanted
    moves_more = law != RESPONSE and other > JUMPED * plausibility.reference_other * max(rise, 1.0)
    if visible and not slipping:
        jumped = may_jump and moves_more and held >= VANISHED * wanted
        building_up = law != RESPONSE and too_much and held < FAR * wanted
        building_up = building_up and other >= GROWN * plausibility.reference_other
        if jumped or building_up or GROWN * plausibility.reference_level <= held <= GROWN * wanted:
            set_reference(expected, plausibility, amplitude_v, min(held, wanted), other)
            return False
        if moves_more and SAGGED * wanted <= held < IN_ORDER * wanted:
            plausibility.reference_v = min(amplitude_v, CREEP * plausibility.reference_v)
            plausibility.out_of_band_periods = 0
            return False
        if held >= IN_ORDER * wanted and not too_much:
            set_reference(expected, plausibility, min(amplitude_v, CREEP * plausibility.reference_v), held, other)
            return False
    fallen = (
        plausibility.reference_level > 0.0 and held < OUT_OF_BAND_PART * plausibility.reference_level and not moves_more
    )
    if rise >= OUT_OF_BAND_RISE or (rise >= RISEN and (fallen or (visible and too_much))):
        plausibility.out_of_band_periods += 1
        plausibility.largest_rise = max(plausibility.largest_rise, rise)
        plausibility.most_periods = max(plausibility.most_periods, plausibility.out_of_band_periods)
    else:
        plausibility.out_of_band_periods = max(plausibility.out_of_band_periods - 1, 0)
    return bool(plausibility.out_of_band_periods >= OUT_OF_BAND_PERIODS)


@kernel
def reset_output(plausibility: Record) -> None:
    """Forget outputs, forces and motions of before: while the output was silent they were not compared."""
    plausibility.sent = plausibility.late_sent = plausibility.late_force = plausibility.late_drive = (
        plausibility.needed
    ) = 0.0
    plausibility.unlike_s = 0.0
    plausibility.silent_periods = 0


@kernel
def permitted_level(plausibility: Record, demanded_v: float) -> float:
    """Return the output amplitude (V), limited to `LARGEST_RISE` times the reference, that a law holding a level may use."""
    return float(min(demanded_v, LARGEST_RISE * plausibility.reference_v))
