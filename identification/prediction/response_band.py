"""The band of several predictions of the same response."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from identification.prediction.steady_prediction import SteadyPrediction
from vibrolock.arrays import Float
from vibrolock.results import Result

_POINTS = 121
"""Phase lags of a band, from 10 to 170 degrees. Chosen."""
_INTERVAL = (2.5, 97.5)
"""Percentiles of a band, which holds 95 %."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseBand(Result):
    """Uncertainty of a predicted response at the drive point.

    Parameters
    ----------
    phase_lag_deg
        float[n], phase lags of the displacement, rising.
    amplitude_m, frequency_hz
        float[2, n], ends of the 95 % intervals at each lag.
    peak_amplitude_std_m, peak_frequency_std_hz
        Standard deviations of the largest amplitude and its frequency.
    draws
        Number of draws.
    """

    phase_lag_deg: Float
    amplitude_m: Float
    frequency_hz: Float
    peak_amplitude_std_m: float
    peak_frequency_std_hz: float
    draws: int


def band_of_responses(responses: Iterable[SteadyPrediction]) -> ResponseBand:
    """Return the band of several predictions of the same response, two at least, by their branches that begin at rest."""
    lags = np.linspace(10.0, 170.0, _POINTS)
    amplitude, frequency, peaks = [], [], []
    for found in responses:
        main = found.branch == 0
        lag = found.phase_lag_deg()[main]
        amplitude.append(np.interp(lags, lag, found.amplitude_m()[main]))
        frequency.append(np.interp(lags, lag, found.frequency_hz[main]))
        peak = found.peak()
        peaks.append((peak.amplitude_m, peak.frequency_hz))
    spread = np.std(peaks, axis=0, ddof=1)
    return ResponseBand(
        phase_lag_deg=lags,
        amplitude_m=np.percentile(amplitude, _INTERVAL, axis=0),
        frequency_hz=np.percentile(frequency, _INTERVAL, axis=0),
        peak_amplitude_std_m=float(spread[0]),
        peak_frequency_std_hz=float(spread[1]),
        draws=len(peaks),
    )
