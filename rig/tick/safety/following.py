"""Compiled watch whether force and motion follow the output, as the plant, known or just measured, says.

There are two witnesses. A linear exciter obeys ``u = alpha(s) F + beta(s) A`` whatever the structure does. Where alpha and beta
are known, every fundamental is held against them (`contradicts_exciter`). Where they are not, the output that sufficed a
moment ago is what was just measured. A law that holds a force or a response may not raise its output beyond `LARGEST_RISE`
times that while what it holds does not follow (`follow_level`).
"""

import math

import numpy as np

from controller.amplitude import RESPONSE
from controller.primitives import TWO_PI, size
from vibrolock.compiled import Record, kernel

__all__ = ["EXPECTED", "FOLLOWING"]

LARGEST_RISE = 2.0  # of the output above what last sufficed, and so also within one period
CREEP = 1.05  # a period: so fast may an output rise by which a held quantity stays at its level
ASTRAY_RISE = 1.5  # from here on a level that does not follow is astray, or with less than half of what there was
ASTRAY_PART = 0.5
ASTRAY_PERIODS = 10
RISEN = 1.2  # from here on an output has risen; a force that sags while a vibration builds up needs no more output
IN_ORDER = 0.9  # of its level: a held quantity that has so much follows
SAGGED = 0.75  # of its level: a force may be so far behind while the vibration builds up
TOO_MUCH = 1.5  # times its level: a law that raises its output then holds something else than it reads
FAR_TOO_MUCH = 3.0  # and so much of a force is not what a vibration takes that builds up
GROWN = 1.1  # times what there was: it follows, although it is far from its level
JUMPED = 1.3  # a force may fall where the vibration grows by so much more than the output: a jump past a turning point
VANISHED = 0.15  # of its level: a force that low is not what such a jump leaves
VISIBLE = 8.0  # times the smallest amplitude of which a phase can be read: about three bits of the converter
SILENT_PERIODS = 40
UNLIKE = 0.6  # of the largest of output sent and terms of the known exciter
TOO_STRONG = 4.0  # times the output: what an amplifier of another gain makes of it, also while the vibration grows
WIDE = 3.0  # times its band, in which the known exciter tells an amplifier of another gain
UNLIKE_PERIODS = 1.0  # of the mode under test, for which it must last

EXPECTED = np.dtype(
    [
        ("known", "i8"),
        ("force_v_n", "f8", (4,)),
        ("acceleration_v_s2_m", "f8", (4,)),
        ("centre_rad_s", "f8"),
        ("lowest_rad_s", "f8"),
        ("highest_rad_s", "f8"),
        ("noise_n", "f8"),
        ("noise_m_s2", "f8"),
        ("visible_n", "f8"),
        ("visible_m_s2", "f8"),
        ("floor_v", "f8"),
        ("force_skew_s", "f8"),
        ("drive_skew_s", "f8"),
    ]
)
"""What is known beforehand (one record). ``known``: whether there is an exciter ``u = alpha F + beta A``, with its
coefficients as in `controller.tuning.PlantModel` and the band in which they hold. ``noise_``: amplitudes below which it is
not judged by. ``visible_``: amplitudes from which on a force or acceleration is told from noise. ``floor_v``: output that is
never too much. ``_skew_s``: delays of the two channels."""

FOLLOWING = np.dtype(
    [
        ("alpha", "c16"),
        ("beta", "c16"),
        ("alpha_rate", "c16"),
        ("beta_rate", "c16"),
        ("sent", "c16"),
        ("late_sent", "c16"),
        ("late_force", "c16"),
        ("late_drive", "c16"),
        ("needed", "c16"),
        ("told", "i8"),
        ("unlike_s", "f8"),
        ("most_unlike_s", "f8"),
        ("silent_periods", "i8"),
        ("reference_v", "f8"),
        ("reference_level", "f8"),
        ("reference_other", "f8"),
        ("astray_periods", "i8"),
        ("largest_rise", "f8"),
        ("most_periods", "i8"),
    ]
)
"""State of the watch (one record). ``alpha``, ``beta``: exciter at this period's frequency, ``_rate`` their derivatives by s,
``told``: whether they are known apart there. ``sent``: complex output as the detector's filter would show it, ``late_`` what
has passed that filter once more, ``needed``: output that the known exciter needs for it. ``unlike_s``: time without a break in
which the two contradict each other, ``most_unlike_s`` the longest. ``silent_periods`` in which one of force and motion showed
nothing and the other much. ``reference_``: output (V), held quantity and the other of
force and motion when the held quantity last followed. ``astray_periods`` since in which it did not, ``most_periods`` of these
there ever were, ``largest_rise`` of the output above its reference in them."""


@kernel
def polynomial(coefficients: np.ndarray, z: complex) -> tuple[complex, complex]:
    """``c_0 + c_1 z + c_2 z^2 + c_3 z^3`` and its derivative."""
    c0, c1, c2, c3 = coefficients[0], coefficients[1], coefficients[2], coefficients[3]
    return complex(c0 + z * (c1 + z * (c2 + z * c3))), complex(c1 + z * (2.0 * c2 + z * 3.0 * c3))


@kernel
def see_frequency(expected: Record, following: Record, omega: float) -> None:
    """Once a period: the known exciter at the frequency of the moment (rad/s), zero where it says nothing.

    It is told within its band, and tells an amplifier of another gain `WIDE` times as far around it.

    ``alpha``, ``beta`` and their derivatives by s, from polynomials in ``z = s/centre``, beta's divided by z^2.
    """
    following.alpha = following.beta = following.alpha_rate = following.beta_rate = 0.0
    following.told = 1 if expected.lowest_rad_s <= omega <= expected.highest_rad_s else 0
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
    following.alpha = alpha * of_force
    following.beta = beta / (z * z) * of_drive
    following.alpha_rate = alpha_slope / expected.centre_rad_s * of_force
    following.beta_rate = (beta_slope - 2.0 * beta / z) / (z * z) / expected.centre_rad_s * of_drive


@kernel
def contradicts_exciter(
    expected: Record, following: Record, sent: complex, force: complex, drive: complex, gain: float, dt_s: float
) -> bool:
    """Once a sample: whether the known exciter has contradicted the output for the time of a period.

    ``sent`` is the complex output (V) whose effect ``force`` (N) and ``drive`` (m/s^2) show. It passes the low-pass of their
    detector, of step ``gain``; all three pass one more, for amplitudes that change: ``U = alpha F + alpha' dF/dt + beta A +
    beta' dA/dt``. What is below the noise is not judged.
    """
    following.sent += gain * (sent - following.sent)
    following.late_sent += gain * (following.sent - following.late_sent)
    force_step, drive_step = gain * (force - following.late_force), gain * (drive - following.late_drive)
    following.late_force += force_step
    following.late_drive += drive_step
    for_force, for_motion = following.alpha * following.late_force, following.beta * following.late_drive
    for_change = (following.alpha_rate * force_step + following.beta_rate * drive_step) / dt_s
    following.needed = for_force + for_motion + for_change
    most = max(size(following.late_sent), size(for_force), size(for_motion), size(for_change))
    noise = size(following.alpha) * expected.noise_n + size(following.beta) * expected.noise_m_s2
    too_strong = size(following.needed) > max(TOO_STRONG * size(following.late_sent), noise)
    unlike = following.told == 1 and most > noise and size(following.late_sent - following.needed) > UNLIKE * most
    unlike = noise > 0.0 and (unlike or too_strong)
    following.unlike_s = following.unlike_s + dt_s if unlike else 0.0
    following.most_unlike_s = max(following.most_unlike_s, following.unlike_s)
    return bool(following.unlike_s > UNLIKE_PERIODS * TWO_PI / expected.centre_rad_s)


@kernel
def silent_side(expected: Record, following: Record, force: float, response: float) -> int:
    """Once a period without a lock: 1 if the force (N), 2 if the motion (m/s^2) has shown nothing for `SILENT_PERIODS`.

    The other one must stand out clearly: a level may also be too low for both.
    """
    no_force = force < expected.visible_n / VISIBLE and response > VISIBLE * expected.visible_m_s2
    no_motion = response < expected.visible_m_s2 / VISIBLE and force > VISIBLE * expected.visible_n
    following.silent_periods = following.silent_periods + 1 if no_force or no_motion else 0
    return 0 if following.silent_periods < SILENT_PERIODS else 1 if no_force else 2


@kernel
def begin_to_follow(expected: Record, following: Record, amplitude_v: float, level: float, other: float) -> None:
    """A law begins to hold a level: what there is now is what the output (V) has sufficed for so far."""
    following.reference_v = max(amplitude_v, expected.floor_v)
    following.reference_level = level
    following.reference_other = other
    following.astray_periods = 0


@kernel
def follow_level(
    expected: Record,
    following: Record,
    period: Record,
    wanted: float,
    law: int,
    slipping: bool,
    may_jump: bool,
) -> bool:
    """Once a period: take in what is held; returns whether it has been astray for `ASTRAY_PERIODS`.

    Of the ``period`` (of `controller.period.PERIOD`) count the output, the fundamentals, and what is held; it should be
    ``wanted`` (N or m). ``slipping``: a lock is about to be lost, so that nothing may be learned.

    What is held follows where it has grown towards its level, or is near it while the output creeps. A force may also be too
    large while the vibration builds up, and sag by less than a quarter, with an output that creeps, where the vibration has
    grown by more than the output has risen. At a frequency that the plan gives (``may_jump``) it may then drop further: so a
    structure jumps past a turning point. It is astray where the output has risen and it has stayed, has fallen to a half
    without any such growth, or is too much.
    """
    amplitude_v, held, force, response = period.output_v, period.held, period.force_n, period.drive_m_s2
    smallest = expected.visible_m_s2 if law == RESPONSE else min(expected.visible_n, IN_ORDER * wanted)
    other = force if law == RESPONSE else response
    visible = (response if law == RESPONSE else force) >= smallest
    rise = amplitude_v / following.reference_v
    too_much = held > TOO_MUCH * wanted
    moves_more = law != RESPONSE and other > JUMPED * following.reference_other * max(rise, 1.0)
    if visible and not slipping:
        jumped = may_jump and moves_more and held >= VANISHED * wanted
        building_up = law != RESPONSE and too_much and held < FAR_TOO_MUCH * wanted
        building_up = building_up and other >= GROWN * following.reference_other
        if jumped or building_up or GROWN * following.reference_level <= held <= GROWN * wanted:
            begin_to_follow(expected, following, amplitude_v, min(held, wanted), other)
            return False
        if moves_more and SAGGED * wanted <= held < IN_ORDER * wanted:
            following.reference_v = min(amplitude_v, CREEP * following.reference_v)
            following.astray_periods = 0
            return False
        if held >= IN_ORDER * wanted and not too_much:
            begin_to_follow(expected, following, min(amplitude_v, CREEP * following.reference_v), held, other)
            return False
    fallen = following.reference_level > 0.0 and held < ASTRAY_PART * following.reference_level and not moves_more
    if rise >= ASTRAY_RISE or (rise >= RISEN and (fallen or (visible and too_much))):
        following.astray_periods += 1
        following.largest_rise = max(following.largest_rise, rise)
        following.most_periods = max(following.most_periods, following.astray_periods)
    else:
        following.astray_periods = max(following.astray_periods - 1, 0)
    return bool(following.astray_periods >= ASTRAY_PERIODS)


@kernel
def permitted_level(following: Record, demanded_v: float) -> float:
    """Output amplitude (V) that a law which holds a level may ask for."""
    return float(min(demanded_v, LARGEST_RISE * following.reference_v))
