"""Noise of the mean over periods, and by how much the last of them differs from it."""

from typing import NamedTuple

import numpy as np

from vibrolock.arrays import Complex, Float


def mean_covariance(periods: Float, size: int) -> Complex | None:
    """Return the covariance of the lines (peak) of the mean over periods, complex[n_lines, n_channels, n_channels].

    Lines are those below half of ``size`` samples a period; ``periods`` are float[n_channels, n_periods, n]. The estimate is
    the scatter of the periods over their number (Pintelon and Schoukens, System Identification, 2nd ed., Section 2.5). Returns
    None for a single period.
    """
    count = periods.shape[1]
    if count < 2:
        return None
    lines = np.fft.rfft(periods, axis=-1)[..., 1 : (size + 1) // 2] * (2.0 / periods.shape[-1])
    left = np.moveaxis(lines - lines.mean(axis=1, keepdims=True), -1, 0)
    return np.asarray(left @ left.conj().swapaxes(1, 2) / ((count - 1) * count))


class PeriodChange(NamedTuple):
    """Mean over the periods of a record less the last of them: noise, and what is left of a transient."""

    values: Float
    """float[n_channels, n], of all inputs and then all outputs."""
    periods: int
    """Number of periods, two at least."""


def period_change(periods: Float) -> PeriodChange | None:
    """Return the change of ``periods``, float[n_channels, n_periods, n]; None for a single period."""
    count = periods.shape[1]
    return PeriodChange(periods.mean(axis=1) - periods[:, -1], count) if count > 1 else None
