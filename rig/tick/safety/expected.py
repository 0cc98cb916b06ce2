"""Knowledge before a run about the output that force and motion need, as the record that the supervision reads."""

import math

import numpy as np

from controller.tuning import PlantModel
from rig.bench import Bench
from rig.tick.safety.response_plausibility import EXPECTED, VISIBLE

# Only amplitudes above JUDGED times the smallest readable amplitude plus NOISES times the channel's RMS noise are judged.
JUDGED = 16.0  # bits of the converter from which the exciter is judged; chosen
NOISES = 8.0  # standard deviations of noise from which it is judged; chosen
TOLD_APART = 3.0  # standard errors; chosen
FLOOR_PART = 0.025  # of the largest voltage: an output that is always allowed


def expected_record(
    bench: Bench,
    smallest_n: float,
    smallest_m_s2: float,
    exciter: PlantModel | None = None,
    per_volt: tuple[float, float] | None = None,
) -> np.ndarray:
    """Return one record of `rig.tick.safety.response_plausibility.EXPECTED`.

    ``smallest_n`` and ``smallest_m_s2`` are the smallest amplitudes whose phase can be read. Of the plant model ``exciter`` the
    exciter's part is used, because a nonlinear structure does not change it, and the structure's as far as a test cannot tell
    the two apart. ``per_volt``: force (N/V) and motion (m/s^2/V) at resonance in the last check of the bench.
    """
    force, drive = (bench.channels[bench.index_of(role)] for role in ("force", "drive"))
    out = np.zeros(1, EXPECTED)
    out["visible_n"], out["visible_m_s2"] = VISIBLE * smallest_n, VISIBLE * smallest_m_s2
    out["noise_n"] = JUDGED * smallest_n + NOISES * force.noise_rms
    out["noise_m_s2"] = JUDGED * smallest_m_s2 + NOISES * drive.noise_rms
    out["floor_v"] = FLOOR_PART * bench.limits.voltage_v
    out["force_skew_s"] = force.skew_samples / bench.sample_rate_hz
    out["drive_skew_s"] = drive.skew_samples / bench.sample_rate_hz
    if per_volt is not None:
        out["checked_n_v"], out["checked_m_s2_v"] = per_volt
    if exciter is not None:
        out["known"] = 1
        out["force_v_n"], out["acceleration_v_s2_m"] = exciter.force_v_n, exciter.acceleration_v_s2_m
        out["centre_rad_s"] = exciter.centre_rad_s
        out["force_v_n_std"] = exciter.force_v_n_std or 0.0
        out["mode"] = exciter.frequency_rad_s, exciter.damping_ratio, exciter.drive_shape**2
        out["residual_per_kg"] = exciter.residual_per_kg
        out["lowest_rad_s"], out["highest_rad_s"] = known_band_rad_s(exciter)
    return out


def known_band_rad_s(plant: PlantModel) -> tuple[float, float]:
    """Return the lowest and highest frequency (rad/s) at which a linear test can distinguish alpha from beta.

    The test measures only the sum in ``u = (alpha + beta Y) F``. Beta dominates near the resonance of the structure and is
    extrapolated elsewhere: on the magnet beam, 3 % above the resonance, beta is wrong by a factor of three. The band is
    therefore where ``|beta Y|`` is at least `TOLD_APART` times ``|alpha|``, and at least half a bandwidth to each side of the
    resonance.
    """
    lock, half = plant.lock_frequency_rad_s(), plant.damping_ratio * plant.frequency_rad_s
    omega = lock + half * np.linspace(-50.0, 50.0, 2001)
    omega = omega[(omega > 2.0 * math.pi * plant.band_hz[0]) & (omega < 2.0 * math.pi * plant.band_hz[1])]
    alpha, beta = plant.exciter(1j * omega)
    told = np.abs(beta * plant.accelerance(1j * omega)) >= TOLD_APART * np.abs(alpha)
    apart = omega[~told]
    lowest = max(apart[apart < lock], default=omega[0])
    highest = min(apart[apart > lock], default=omega[-1])
    return float(min(lowest, lock - half)), float(max(highest, lock + half))
