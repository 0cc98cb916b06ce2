"""Uncertainty of predicted responses from the standard errors of a nonlinear mode, by Monte Carlo.

The modal frequencies and damping ratios are drawn about their values, independently at each level. An error of the
mass-normalised drive shape is common to all levels and cancels at the drive point: q, phi_d and z change so that the
predicted displacement per force remains the same.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from identification.errors import IdentificationError
from identification.models.modal.frequency_response import HeldForce, frequency_response
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import SteadyPrediction
from vibrolock.arrays import Float
from vibrolock.results import Result

_POINTS = 121
_INTERVAL = (2.5, 97.5)
_LEAST_SHARE = 0.05


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


def response_band(
    mode: NonlinearMode,
    force_n: float,
    *,
    force: HeldForce = "fundamental",
    draws: int = 200,
    seed: int = 0,
    allow_extrapolation: bool = False,
) -> ResponseBand:
    """Propagate the standard errors of modal frequency and damping to a predicted response, by Monte Carlo.

    Parameters
    ----------
    mode, force_n, force, allow_extrapolation
        As for `frequency_response`.
    draws
        Number of draws, at least 20.
    seed
        Seed of the random numbers.

    Raises
    ------
    IdentificationError
        If a level has no standard error, or ``draws`` is below 20.
    """
    if draws < 20:
        raise IdentificationError(f"draws: is {draws}, needs at least 20")
    for name in ("modal_frequency_std_hz", "damping_ratio_std"):
        if not np.all(np.isfinite(getattr(mode, name))):
            raise IdentificationError(f"{name}: unknown at some level, the band cannot be had without it")
    random = np.random.default_rng(seed)
    return band_of_responses(
        frequency_response(
            _drawn(mode, random), force_n, force=force, points=_POINTS, allow_extrapolation=allow_extrapolation
        )
        for _ in range(draws)
    )


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


def _drawn(mode: NonlinearMode, random: np.random.Generator) -> NonlinearMode:
    """Return one draw of the mode; damping ratios stay above a twentieth of their value."""
    levels = mode.force_n.size
    moved = mode.damping_ratio_std * random.standard_normal(levels)
    return replace(
        mode,
        modal_frequency_hz=mode.modal_frequency_hz + mode.modal_frequency_std_hz * random.standard_normal(levels),
        damping_ratio=np.maximum(mode.damping_ratio + moved, _LEAST_SHARE * mode.damping_ratio),
        damping_ratio_total_power=np.maximum(
            mode.damping_ratio_total_power + moved, _LEAST_SHARE * mode.damping_ratio_total_power
        ),
    )
