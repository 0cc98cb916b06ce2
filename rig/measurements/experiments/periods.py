"""Multisine realisations as experiments: a settled period each, resampled without any error where the rates allow it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification import Experiment, IdentificationError
from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, result_of
from rig.campaigns.evaluation.vibrations import skew_turn
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MultisineResult, turned_periods
from rig.measurements.experiments.signals import Signals

__all__ = ["Periods", "WantedPeriods", "realisation"]

Periods = Literal["mean", "all"]


@dataclass(frozen=True, kw_only=True)
class WantedPeriods:
    """How realisations become experiments."""

    rate_hz: float
    """Sample rate of the experiments, Hz."""
    periods: Periods
    """The mean over the periods of a realisation, or all of them."""
    transient_periods: float
    """Periods that are put ahead and do not count."""


def realisation(
    signals: Signals,
    plan: MultisinePlan,
    point: Point[MultisineResult],
    rows: np.ndarray,
    wanted: WantedPeriods,
    name: str,
) -> Experiment:
    """The mean over a realisation's periods, or all of them one after the other, begun where the signal begins.

    Periods in which samples were lost are left out. Raises `IdentificationError` where none is left, or a period is no
    whole number of samples at the wanted rate.
    """
    bench, rate_hz = signals.bench, wanted.rate_hz
    played = plan.model_copy(update={"periods": result_of(point).periods})
    recorded = turned_periods(bench, played, point.realisation or 0, rows)
    if wanted.periods == "mean":
        recorded = recorded.mean(axis=1, keepdims=True)
    size = samples_of_a_period(plan, bench, rate_hz)
    slow = _resampled(recorded, bench, size, signals.offset)
    once = slow.reshape(slow.shape[0], -1)
    ahead = round(wanted.transient_periods * size)
    both = np.concatenate([once[:, np.arange(-ahead, 0) % once.shape[1]], once], axis=1)
    return Experiment(
        inputs=both[list(signals.inputs)],
        outputs=both[list(signals.outputs)],
        sample_rate_hz=rate_hz,
        input_channels=signals.input_channels,
        output_channels=signals.output_channels,
        counted_from=ahead,
        period_samples=size,
        name=name,
        level=point.level,
        specimen=bench.specimen.name,
        excited_hz=(plan.lowest_hz, plan.highest_hz),
    )


def samples_of_a_period(plan: MultisinePlan, bench: Bench, rate_hz: float) -> int:
    """Samples of a period at another rate; `IdentificationError` where that is no whole number."""
    exact = plan.design(bench.sample_rate_hz).period_samples * rate_hz / bench.sample_rate_hz
    size = round(exact)
    if size < 1 or abs(exact - size) > 1e-6:
        raise IdentificationError(
            f"rate_hz: is {rate_hz:g} Hz, a period of {1.0 / plan.resolution_hz:g} s then has {exact:.6g} samples; allowed are "
            f"whole multiples of {plan.resolution_hz:g} Hz"
        )
    return size


def _resampled(recorded: np.ndarray, bench: Bench, size: int, offset: np.ndarray) -> np.ndarray:
    """float[n_channels + 1, n_periods, n] with ``size`` samples a period: its lines below the new Nyquist frequency alone.

    Exact for what lies there, and nothing folds back; the channels' skew is taken out, and the mean where it is an offset.
    """
    count = recorded.shape[-1]
    lines = np.fft.rfft(recorded, axis=-1)[..., : size // 2 + 1]
    frequency_hz = np.arange(lines.shape[-1]) * bench.sample_rate_hz / count
    lines[:-1] *= skew_turn(bench, frequency_hz)[:, None]
    lines[offset, :, 0] = 0.0
    if size % 2 == 0 and size < count:
        lines[..., -1] = 0.0  # the Nyquist frequency itself: half of it would have folded
    return np.asarray(np.fft.irfft(lines, size, axis=-1) * (size / count))
