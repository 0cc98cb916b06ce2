"""Multisine realisations as experiments: one settled period each, resampled without error if the rates allow it."""

from typing import Literal

import numpy as np

from identification import Experiment, IdentificationError
from identification.experiments import mean_covariance, period_change
from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, result_of
from rig.campaigns.evaluation.vibrations import channel_factors
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MultisineResult, turned_periods
from rig.measurements.experiments.signals import Signals

Periods = Literal["mean", "all"]


def realisation(
    signals: Signals,
    plan: MultisinePlan,
    point: Point[MultisineResult],
    rows: np.ndarray,
    *,
    rate_hz: float,
    periods: Periods,
    transient_periods: float,
    name: str,
) -> Experiment:
    """Return the mean over a realisation's periods, or all ``periods`` in sequence, begun where the signal begins.

    ``transient_periods`` put ahead do not count in errors. Periods with lost samples are left out. Raises
    `IdentificationError` if no period is left, or if a period is not a whole number of samples at the wanted rate.
    """
    bench = signals.bench
    played = plan.model_copy(update={"periods": result_of(point).periods})
    recorded = turned_periods(bench, played, point.realisation or 0, rows)
    size = samples_of_a_period(plan, bench, rate_hz)
    noise, change, chosen = None, None, [*signals.inputs, *signals.outputs]
    if periods == "mean":
        change = period_change(_resampled(recorded, bench, size, signals.offset)[chosen])
        noise = mean_covariance(recorded[chosen], size)
        if noise is not None:
            hz = np.arange(1, len(noise) + 1) * bench.sample_rate_hz / recorded.shape[-1]
            factors = np.vstack([channel_factors(bench, hz), np.ones(hz.size)])[chosen].T  # the last row is the voltage
            noise = factors[:, :, None] * noise * factors[:, None, :].conj()
        recorded = recorded.mean(axis=1, keepdims=True)
    slow = _resampled(recorded, bench, size, signals.offset)
    once = slow.reshape(slow.shape[0], -1)
    ahead = round(transient_periods * size)
    both = np.concatenate([once[:, np.arange(-ahead, 0) % once.shape[1]], once], axis=1)
    return signals.experiment(
        both,
        rate_hz,
        counted_from=ahead,
        period_samples=size,
        name=name,
        level=point.level,
        excited_hz=(plan.lowest_hz, plan.highest_hz),
        noise_covariance=noise,
        period_change=change,
    )


def samples_of_a_period(plan: MultisinePlan, bench: Bench, rate_hz: float) -> int:
    """Return the samples of a period at another rate; raise `IdentificationError` if this is not a whole number."""
    exact = plan.design(bench.sample_rate_hz).period_samples * rate_hz / bench.sample_rate_hz
    size = round(exact)
    if size < 1 or abs(exact - size) > 1e-6:
        raise IdentificationError(
            f"a period of {1.0 / plan.resolution_hz:g} s then has {exact:.6g} samples",
            field="rate_hz",
            value=rate_hz,
            allowed=f"whole multiples of {plan.resolution_hz:g} Hz",
        )
    return size


def _resampled(recorded: np.ndarray, bench: Bench, size: int, offset: np.ndarray) -> np.ndarray:
    """Resample to ``size`` samples per period, keeping only the lines below the new Nyquist frequency.

    The result is float[n_channels + 1, n_periods, n]. It is exact for these lines, and nothing aliases. The skew of the
    channels and the high-pass of their sensors are removed, and so is the mean of channels where it is a sensor offset.
    """
    count = recorded.shape[-1]
    lines = np.fft.rfft(recorded, axis=-1)[..., : size // 2 + 1]
    frequency_hz = np.arange(lines.shape[-1]) * bench.sample_rate_hz / count
    lines[:-1] *= channel_factors(bench, frequency_hz)[:, None]
    lines[offset, :, 0] = 0.0
    if size % 2 == 0 and size < count:
        lines[..., -1] = 0.0  # half of the line at the Nyquist frequency would have aliased
    return np.asarray(np.fft.irfft(lines, size, axis=-1) * (size / count))
