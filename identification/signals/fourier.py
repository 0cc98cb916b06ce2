"""Fourier coefficients of every channel by least squares on the phase of the oscillator.

The record is ``y(t) = Re sum_h Y_h exp(i h theta(t))`` plus a residual, with the recorded phase theta. A varying frequency
therefore causes no smearing, and a period need not be a whole number of samples. A slow drift of the fundamental,
``(t - t_mid) Re(Z exp(i theta))``, is fitted as a nuisance term. It does not change the fundamental itself (over whole
periods the two are orthogonal). Without it, however, a drift would leak into the static part and the higher harmonics, which
are often a thousand times smaller, and would count as noise in the residual. The fitted drift is reported.

The ripple of a detector modulates the phase of the oscillator within every period. A periodic vibration is a Fourier series
in time, that is, in a uniformly advancing phase; with a modulated phase, harmonics leak into each other (a modulation of one
milliradian assigns 0.1 % of F_2 to F_1). The part of the phase that repeats within every period is therefore removed first;
slow variations remain.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from identification.signals.chunks import ArrayRecord, Phase, Record, check_samples
from identification.signals.columns import Columns, least_squares
from identification.signals.rounding import JUDGED, part_of_each, rounding_errors
from identification.signals.turns import turns_of
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float

_MAX_BATCHES = 20
"""Batches of periods from which standard errors come, at most. Chosen."""
_MIN_BATCHES = 4
"""Fewest batches that give a standard error. Chosen."""
_MANY = 50
"""Number of batches where there are too few periods for standard errors. Chosen."""
_MOST_LOST = 0.05
"""Largest share of lost samples in a record. Chosen: harmonics of the rest are then right to their noise."""
_SHAPE_HARMONICS = 30
"""Harmonics of the mean period that are taken beyond the requested ones. Chosen."""
_BELOW_HALF = 0.45  # of the samples per period: highest harmonic of a shape
_THIRD_DIFFERENCES = 20.0  # variance of a third difference of white noise: 1 + 9 + 9 + 1
_SAMPLES_TO_SPARE = 3  # largest number of samples beyond the last whole period that is left out without a warning


def periodic_vibration(
    theta_rad: ArrayLike,
    samples: ArrayLike,
    channels: Sequence[Channel],
    *,
    sample_rate_hz: float,
    harmonics: int = 7,
    resolution: ArrayLike | None = None,
    noise_rms: ArrayLike | None = None,
    lost: ArrayLike | None = None,
    phase_lag_target_deg: float = 90.0,
    settled: bool = True,
) -> PeriodicVibration:
    """Compute the periodic vibration in a settled record.

    Returns the vibration over the whole periods from the start of the record. ``harmonics_std`` is the scatter of the
    residual's coefficients over up to 20 batches of whole periods, which fully includes coloured noise and slow
    variations. Below four periods it takes the residual as white noise. With ``resolution`` it includes
    ``rounding_std``, the rounding error that repeats in every period (`identification.signals.rounding`). It does not
    include calibration errors or run-to-run scatter.

    Raises `IdentificationError` if values are NaN or infinite, lengths differ, there is less than one period, the
    phase falls, there are too few samples per period for H, or more than 5 % of the samples are lost.

    Parameters
    ----------
    theta_rad
        float[n], phase of the oscillator at the instant that each sample was measured, rising; wrapped or not.
    samples
        float[n_channels, n], in the unit of each channel, SI.
    channels
        The channels, one per row of ``samples``.
    sample_rate_hz
        Samples per second.
    harmonics
        Highest harmonic H.
    resolution
        float[n_channels], step of each channel's converter in the unit of the channel, 0 for none; None if unknown.
    noise_rms
        float[n_channels], noise ahead of the converter as far as it is known, 0 where it is not; None if unknown. More noise
        than the residual has does not count.
    lost
        bool[n], true where a sample was lost: values of ``samples`` there, such as NaN, are ignored. None: no sample was
        lost.
    phase_lag_target_deg, settled
        Passed to the result.
    """
    theta = finite_array("theta_rad", theta_rad, np.float64, 1)
    gone = _lost(lost, theta.size)
    values = np.where(gone, 0.0, samples) if gone.any() else samples
    data = finite_array("samples", values, np.float64, 2)
    check_samples(data, channels, theta.size)
    return vibration_in(
        ArrayRecord(theta, data, gone),
        channels,
        sample_rate_hz=sample_rate_hz,
        harmonics=harmonics,
        resolution=resolution,
        noise_rms=noise_rms,
        phase_lag_target_deg=phase_lag_target_deg,
        settled=settled,
    )


def vibration_in(
    record: Record,
    channels: Sequence[Channel],
    *,
    sample_rate_hz: float,
    harmonics: int = 7,
    resolution: ArrayLike | None = None,
    noise_rms: ArrayLike | None = None,
    phase_lag_target_deg: float = 90.0,
    settled: bool = True,
) -> PeriodicVibration:
    """Compute the periodic vibration in a record that is read in chunks; all else as in `periodic_vibration`.

    The memory that this takes does not grow with the length of the record.
    """
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    IdentificationError.unless_at_least("harmonics", harmonics, 1)
    phase = Phase(record)
    frequency_hz, periods, count, warnings = _whole_periods(phase, record.size, rate_hz, harmonics)
    chunks = Columns(record, phase, count, harmonics, many=periods >= _MIN_BATCHES)
    solution, kept = _solved(chunks)
    squares, rough, means, first = _residual(chunks, solution, periods)
    coefficients = np.asarray((solution[: harmonics + 1] + 1j * solution[harmonics + 1 : -2]).T)
    drift = solution[-2] + 1j * solution[-1]
    residual_rms = np.sqrt(squares / kept)
    scatter = _standard_errors(squares, means, kept, periods, harmonics)
    steps = _per_channel("resolution", resolution, len(channels))
    seen_rms = np.sqrt(np.maximum(np.minimum(rough, squares) / kept - steps**2 / 12.0, 0.0))
    known_rms = _per_channel("noise_rms", noise_rms, len(channels))
    dither_rms = np.where(known_rms > 0.0, np.minimum(known_rms, residual_rms), seen_rms)
    rounding = rounding_errors(*_shape_of(chunks, first, coefficients), steps, dither_rms, harmonics)
    return PeriodicVibration(
        channels=tuple(channels),
        frequency_hz=frequency_hz,
        harmonics=coefficients,
        periods=periods,
        residual_rms=residual_rms,
        harmonics_std=np.hypot(scatter, part_of_each(rounding)),
        drift=np.divide(drift, coefficients[:, 1], out=np.zeros_like(drift), where=coefficients[:, 1] != 0.0),
        rounding_std=rounding if resolution is not None else None,
        phase_lag_target_deg=phase_lag_target_deg,
        settled=settled,
        warnings=warnings,
    )


def _lost(lost: ArrayLike | None, size: int) -> NDArray[np.bool_]:
    if lost is None:
        return np.zeros(size, np.bool_)
    gone = finite_array("lost", lost, np.bool_, 1)
    if gone.size != size:
        raise IdentificationError(f"has {gone.size} values", field="lost", allowed=f"{size}, one per sample")
    _refuse_lost(int(gone.sum()), size)
    return gone


def _refuse_lost(lost: int, size: int) -> None:
    if lost > _MOST_LOST * size:
        reason = f"{lost} of {size} were lost"
        raise IdentificationError(reason, field="samples", allowed=f"up to {100.0 * _MOST_LOST:g} %")


def _per_channel(name: str, given: ArrayLike | None, channels: int) -> Float:
    """float[n_channels]: converter steps or noise; zero where unknown."""
    if given is None:
        return np.zeros(channels)
    values = finite_array(name, given, np.float64, 1)
    if values.size != channels or np.any(values < 0.0):
        raise IdentificationError(field=name, value=given, allowed=f"{channels} numbers of 0 or above, one per channel")
    return values


def _whole_periods(phase: Phase, size: int, rate_hz: float, harmonics: int) -> tuple[float, int, int, tuple[str, ...]]:
    """Return mean frequency, number of whole periods, number of samples in them, and warnings."""
    step = (phase.last - phase.first) / (size - 1)
    # The last sample covers one sampling interval. A period is seldom a whole number of samples, and a recorder may end up to
    # one sample early. Least squares tolerates this; otherwise a whole period would be lost.
    covered = size * step / (2.0 * np.pi)
    periods = int(covered + step / (2.0 * np.pi) + 1e-6)
    if periods < 1:
        reason = f"covers {covered:.3f} periods"
        raise IdentificationError(reason, field="theta_rad", allowed="at least one whole period")
    needed = 2 * harmonics + 2
    if 2.0 * np.pi / step <= needed:
        reason = f"{harmonics} need more than {needed} samples per period, the record has {2 * np.pi / step:.2f}"
        raise IdentificationError(reason, field="harmonics")
    count = phase.samples_below(2.0 * np.pi * periods - 0.5 * step)
    warnings = []
    if size - count > _SAMPLES_TO_SPARE:
        warnings.append(f"{size - count} samples beyond {periods} whole periods are left out")
    if periods < _MIN_BATCHES:
        warnings.append(
            f"{periods} periods only: standard errors take the residual for white noise, drift is not fitted"
        )
    return float(step * rate_hz / (2.0 * np.pi)), periods, count, tuple(warnings)


def _solved(chunks: Columns) -> tuple[Float, int]:
    """Return the solution of least squares, float[2 H + 4, n_channels], and the number of samples behind it."""
    normal: Float | float = 0.0
    right: Float | float = 0.0
    lost = 0
    for chunk in chunks:
        normal = normal + chunk.design.T @ chunk.design
        right = right + chunk.design.T @ chunk.data
        lost += int(chunk.lost.sum())
        del chunk  # before the next is read
    _refuse_lost(lost, chunks.count)
    return least_squares(np.asarray(normal), np.asarray(right)), chunks.count - lost


def _residual(chunks: Columns, solution: Float, periods: int) -> tuple[Float, Float, Float | None, Float]:
    """Return sums of squares of the residual and of its white part, its coefficients batch by batch, and its first samples.

    The sums are float[n_channels]. The white part is that of third differences, which higher harmonics and slow variations
    hardly have. The coefficients are float[n_batches, 2 H + 2, n_channels]; None below four periods. The first samples, from
    which the rounding is judged, are float[n, n_channels].
    """
    columns = solution.shape[0] - 2
    batches = batches_of(periods) if periods >= _MIN_BATCHES else 0
    squares, rough = np.zeros(solution.shape[1]), np.zeros(solution.shape[1])
    sums, known = np.zeros((batches, columns, solution.shape[1])), np.zeros(batches, int)
    borders: Float | None = None
    first = np.zeros((0, solution.shape[1]))
    for chunk in chunks:
        residual = chunk.design @ solution
        np.subtract(chunk.data, residual, out=residual)
        if borders is None:
            first = residual[:JUDGED]
            borders = chunk.theta[0] + 2.0 * np.pi * np.round(np.linspace(0, periods, batches + 1))
        edges = np.searchsorted(chunk.theta, borders)
        for batch, (start, stop) in enumerate(pairwise(edges)):
            if stop > start:
                sums[batch] += chunk.design[start:stop, :columns].T @ residual[start:stop]
                known[batch] += stop - start - np.count_nonzero(chunk.lost[start:stop])
        thirds = np.diff(residual, 3, axis=0)
        rough += np.einsum("kc,kc->c", thirds, thirds) / _THIRD_DIFFERENCES
        squares += np.einsum("kc,kc->c", residual, residual)
        del chunk, residual, thirds  # before the next is read
    return squares, rough, sums / np.maximum(known, 1)[:, None, None] if batches else None, first


def _shape_of(chunks: Columns, residual: Float, coefficients: Complex) -> tuple[Float, Complex]:
    """Return `turns_of` the first samples, whose residual is given, and the harmonics there: more than are asked for.

    Rounding depends on the shape of a vibration to a fraction of a step, to which harmonics above H still contribute.
    """
    chunk = next(iter(chunks))
    theta = chunk.theta[:JUDGED]
    per_period = 2.0 * np.pi * (theta.size - 1) / (theta[-1] - theta[0])
    first, last = coefficients.shape[1], min(_SHAPE_HARMONICS, int(_BELOW_HALF * per_period))
    lower = chunk.design.T[:-2, :JUDGED].reshape(2, first, theta.size)
    turns = turns_of(theta, max(last, first - 1), lower=lower)
    real, imaginary = turns[:, first:] @ residual
    return turns, np.hstack([coefficients, (real + 1j * imaginary).T * (2.0 / theta.size)])


def batches_of(periods: int) -> int:
    """Number of batches behind standard errors from ``periods`` periods; a large number below four, where all samples count."""
    return min(_MAX_BATCHES, periods) if periods >= _MIN_BATCHES else _MANY


def _standard_errors(squares: Float, means: Float | None, kept: int, periods: int, harmonics: int) -> Float:
    """float[n_channels, H + 1]: standard error of Re and of Im of each coefficient; arguments as from `_residual`."""
    twice = np.r_[1.0, np.full(harmonics, 2.0)]  # means of cosine and sine are half the amplitude
    if means is None:
        variance = squares / max(kept - 2 * harmonics - 1, 1)
        return np.asarray(np.sqrt(np.outer(variance, twice) / kept))
    batches = batches_of(periods)
    # The residual's mean over the record is zero: batches - 1 are free.
    squared = np.sum(means**2, axis=0) / ((batches - 1) * batches)
    return np.asarray(np.sqrt(twice * squared.reshape(2, harmonics + 1, -1).sum(axis=0).T))
