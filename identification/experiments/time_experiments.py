"""Time records as training and test data of models over time.

A periodic record becomes one settled period, the mean over its periods, with periods ahead in which the transient of a
simulation decays. It is resampled without error: its lines below the new Nyquist frequency are kept, all others dropped. A
record that is not periodic is taken whole, filtered and decimated (`identification.signals.decimation`).
"""

import math
from collections.abc import Sequence

import numpy as np

from identification.channels import chosen_rows
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.experiments.noise import mean_covariance, period_change
from identification.experiments.periodicity import check_periods
from identification.experiments.time_records import TimeRecord, TimeRecords
from identification.signals.decimation import EDGE_SAMPLES, decimated
from identification.validation import positive
from vibrolock.arrays import Float

SAMPLES_PER_PERIOD = 25
"""Samples per period of the highest excited frequency."""
_ROUND = (8.0, 5.0, 4.0, 2.5, 2.0, 1.0)  # leading digits of a round sample rate; chosen
_SAME = 1e-9  # relative difference up to which two rates are equal; chosen: rounding only
_EXCITED = 1e-2  # amplitude of an excited line, at least, over the strongest of its channel; chosen


def round_rate_hz(most_hz: float) -> float:
    """Return a round sample rate at or just below ``most_hz``."""
    decade = 10.0 ** math.floor(math.log10(most_hz))
    return next(factor * decade for factor in _ROUND if factor * decade <= most_hz * (1.0 + 1e-12))


def suitable_rate_hz(records: TimeRecords) -> float:
    """Return the sample rate of the records, or a lower one if they have far more samples than a model needs.

    That is a rate just below 25 samples per period of the highest excited frequency, where that is known. A period stays a
    whole number of samples, and other records are decimated by a whole number.
    """
    rate_hz = records.sample_rate_hz
    if records.excited_hz is None or SAMPLES_PER_PERIOD * records.excited_hz[1] >= rate_hz:
        return rate_hz
    most_hz = SAMPLES_PER_PERIOD * records.excited_hz[1]
    if records.period_samples:
        period_s = records.period_samples / rate_hz
        wanted = round_rate_hz(most_hz)
        whole = abs(wanted * period_s - round(wanted * period_s)) <= _SAME * wanted * period_s
        return wanted if whole else max(math.floor(most_hz * period_s), 1) / period_s
    return rate_hz / math.ceil(rate_hz / most_hz)


def time_experiments(
    records: TimeRecords,
    *,
    inputs: Sequence[str] = ("force",),
    outputs: Sequence[str] | None = None,
    rate_hz: float | None = None,
) -> tuple[Experiment, ...]:
    """Return one experiment for each record, in their order. The band of periodic records, if unknown, is that of their inputs.

    Raises `IdentificationError` if a channel does not exist, the rate does not fit, a record is too short for it, or
    has no such periods.

    Parameters
    ----------
    records
        The records.
    inputs, outputs
        Names or roles of channels. Without ``outputs``: all motions, and the force if it is not an input.
    rate_hz
        Sample rate of the experiments, at most that of the records; by default `suitable_rate_hz`.
    """
    into, out = chosen_rows(records.channels, inputs, outputs)
    check_periods(records)
    rate = suitable_rate_hz(records) if rate_hz is None else positive("rate_hz", rate_hz, "Hz")
    if rate > records.sample_rate_hz * (1.0 + _SAME):
        allowed = f"up to {records.sample_rate_hz:g} Hz, as fast as was recorded"
        raise IdentificationError(field="rate_hz", value=rate, allowed=allowed)
    return tuple(_experiment(records, record, into, out, rate) for record in records.records)


def _experiment(
    records: TimeRecords, record: TimeRecord, into: Sequence[int], out: Sequence[int], rate_hz: float
) -> Experiment:
    size, ahead, noise, change, band = 0, 0, None, None, records.excited_hz
    if records.period_samples:
        periods = resampled_periods(record.samples, records.period_samples, records.sample_rate_hz, rate_hz)
        size = periods.shape[-1]
        noise, change = mean_covariance(periods[[*into, *out]], size), period_change(periods[[*into, *out]])
        ahead = round(records.ahead_periods * size)
        band = band or _band(periods[list(into)].mean(axis=1), rate_hz)
        values = periods.mean(axis=1)[:, np.arange(-ahead, size) % size]
    else:
        values = _slower(record, records, rate_hz)
    return Experiment(
        inputs=values[list(into)],
        outputs=values[list(out)],
        sample_rate_hz=rate_hz,
        input_channels=tuple(records.channels[row] for row in into),
        output_channels=tuple(records.channels[row] for row in out),
        counted_from=ahead,
        period_samples=size,
        initial_state="zero" if records.period_samples or records.at_rest else "estimated",
        name=record.name,
        level=record.level,
        specimen=records.specimen,
        excited_hz=band,
        noise_covariance=noise,
        period_change=change,
    )


def _band(inputs: Float, rate_hz: float) -> tuple[float, float] | None:
    """Return the lowest and highest line with a hundredth of the strongest of any input; None without two of them."""
    size = inputs.shape[1]
    lines = np.abs(np.fft.rfft(inputs, axis=1))[:, 1 : (size + 1) // 2]
    excited = 1 + np.flatnonzero(np.any((lines >= _EXCITED * lines.max(axis=1, keepdims=True)) & (lines > 0.0), axis=0))
    return (float(excited[0] * rate_hz / size), float(excited[-1] * rate_hz / size)) if excited.size > 1 else None


def resampled_periods(samples: Float, period_samples: int, rate_hz: float, new_rate_hz: float) -> Float:
    """float[n_channels, n_periods, n]: whole periods at another rate, with the lines below the new Nyquist frequency alone.

    ``samples`` is float[n_channels, n_periods * period_samples]. Raises `IdentificationError` if a period is not a whole number
    of samples at the new rate.
    """
    exact = period_samples * new_rate_hz / rate_hz
    size = round(exact)
    if size < 3 or abs(exact - size) > 1e-6:
        reason = f"a period of {period_samples} samples at {rate_hz:g} Hz then has {exact:.6g} samples"
        allowed = f"whole multiples of {rate_hz / period_samples:g} Hz"
        raise IdentificationError(reason, field="rate_hz", value=new_rate_hz, allowed=allowed)
    periods = samples.reshape(len(samples), -1, period_samples)
    if size == period_samples:
        return periods
    lines = np.fft.rfft(periods, axis=-1)[..., : size // 2 + 1]
    if size % 2 == 0:
        lines[..., -1] = 0.0  # half of the line at the Nyquist frequency would have aliased
    return np.asarray(np.fft.irfft(lines, size, axis=-1) * (size / period_samples))


def _slower(record: TimeRecord, records: TimeRecords, rate_hz: float) -> Float:
    """Return the samples at a lower rate, without the ends that the filter has spoilt; a beginning at rest is not spoilt."""
    if abs(rate_hz / records.sample_rate_hz - 1.0) <= _SAME:
        return record.samples
    slow = decimated(record.samples, records.sample_rate_hz, rate_hz)
    first = 0 if records.at_rest else EDGE_SAMPLES
    if slow.shape[1] <= first + EDGE_SAMPLES:
        raise IdentificationError(
            f"record '{record.name}': is too short for {rate_hz:g} Hz, at which {slow.shape[1]} samples are left and "
            f"{EDGE_SAMPLES} at either end are spoilt"
        )
    return slow[:, first : slow.shape[1] - EDGE_SAMPLES]
