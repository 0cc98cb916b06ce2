"""What the spectra of a tuning's multisine tell: coherence, responses, noise."""

import numpy as np
from numpy.typing import NDArray

from identification import FrequencyResponseMatrix, PeriodicSpectra, best_linear_approximation
from rig.bench import Bench

__all__ = ["FIT_BAND", "coherence_of", "densities", "near", "voltage_responses"]

Real = NDArray[np.float64]

FIT_BAND = (0.6, 1.6)  # of the linear frequency: that of the plant's model


def coherence_of(bench: Bench, measured: PeriodicSpectra) -> tuple[float, float]:
    """Median coherence of force and drive with the voltage around the mode, of one period."""
    around = near(bench, measured.frequency_hz) & measured.excited
    out = []
    for role in ("force", "drive"):
        index = measured.index(next(c.name for c in bench.channels if c.role == role))
        power = np.mean(np.abs(measured.mean[:, index][:, around]) ** 2, axis=0)
        noise = np.mean(measured.noise_variance[:, index][:, around], axis=0)
        signal = np.maximum(power - noise / measured.spectra.shape[1], 0.0)
        out.append(float(np.median(signal)) / max(float(np.median(signal)) + float(np.median(noise)), 1e-300))
    return out[0], out[1]


def voltage_responses(bench: Bench, measured: PeriodicSpectra) -> FrequencyResponseMatrix:
    """Force, drive acceleration, and the accelerations of all response channels per volt, with covariance."""
    names = [c.name for role in ("force", "drive", "response") for c in bench.channels if c.role == role]
    return best_linear_approximation(measured, outputs=names, inputs=("voltage",), specimen=bench.specimen.name)


def near(bench: Bench, frequency_hz: Real) -> NDArray[np.bool_]:
    """Which lines lie in the band of the plant's model."""
    linear = bench.specimen.linear_frequency_hz
    return np.asarray((frequency_hz > FIT_BAND[0] * linear) & (frequency_hz < FIT_BAND[1] * linear))


def densities(bench: Bench, measured: PeriodicSpectra) -> tuple[float, float]:
    """One-sided noise densities: a line of resolution d carries the power S d, half the square of its peak amplitude."""
    around = near(bench, measured.frequency_hz)
    step = float(np.diff(measured.frequency_hz).mean())
    rows = [measured.index(next(c.name for c in bench.channels if c.role == role)) for role in ("force", "drive")]
    variance = [float(np.mean(measured.noise_variance[:, row][:, around])) for row in rows]
    return 0.5 * variance[0] / step, 0.5 * variance[1] / step
