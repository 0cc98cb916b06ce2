"""What is known before a run of the output that force and motion need: the record that the watch reads."""

import math

import numpy as np

from controller.tuning import PlantModel
from rig.bench import Bench
from rig.safety.following.layout import EXPECTED

__all__ = ["expected_record"]

VISIBLE = 8.0  # times the smallest amplitude of which a phase can be read: about three bits of the converter
JUDGED = 16.0  # times that smallest amplitude, and
NOISES = 8.0  # times the noise that the bench states for a channel (RMS), from which on the exciter is judged
FLOOR_PART = 0.025  # of the largest voltage: where the output may always be


def expected_record(
    bench: Bench, smallest_n: float, smallest_m_s2: float, exciter: PlantModel | None = None
) -> np.ndarray:
    """One record of `rig.safety.following.layout.EXPECTED`.

    ``smallest_n`` and ``smallest_m_s2`` are the smallest amplitudes of which a phase can be read. Of the plant only the
    ``exciter`` counts: it is the part that a nonlinear structure leaves as it is.
    """
    force, drive = (bench.channels[bench.index_of(role)] for role in ("force", "drive"))
    out = np.zeros(1, EXPECTED)
    out["visible_n"], out["visible_m_s2"] = VISIBLE * smallest_n, VISIBLE * smallest_m_s2
    out["noise_n"] = JUDGED * smallest_n + NOISES * force.noise_rms
    out["noise_m_s2"] = JUDGED * smallest_m_s2 + NOISES * drive.noise_rms
    out["floor_v"] = FLOOR_PART * bench.limits.voltage_v
    out["force_skew_s"] = force.skew_samples / bench.sample_rate_hz
    out["drive_skew_s"] = drive.skew_samples / bench.sample_rate_hz
    if exciter is not None:
        out["known"] = 1
        out["force_v_n"], out["acceleration_v_s2_m"] = exciter.force_v_n, exciter.acceleration_v_s2_m
        out["centre_rad_s"] = exciter.centre_rad_s
        out["lowest_rad_s"], out["highest_rad_s"] = (2.0 * math.pi * end for end in exciter.band_hz)
    return out
