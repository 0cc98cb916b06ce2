"""Best linear approximation of the periodic experiments, from which a nonlinear state-space model is identified.

Experiments are first checked to be periodic and settled. Pintelon and Schoukens, *System Identification: A Frequency Domain
Approach*, 2nd ed., chapters 3 and 4; the estimate is `identification.multisine.best_linear_approximation`.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, excited_band, same_channels
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.multisine.best_linear_approximation import best_linear_approximation
from identification.multisine.spectra import PeriodicSpectra
from vibrolock.arrays import Complex

_DIFFERENCE = 0.3
"""Largest RMS difference of two periods relative to the signal; a larger one is not noise, or the noise hides the signal."""
_SETTLED_PART = 32
"""Just before the counted part, 1/32 of a period is compared with the same part one period later."""
_EXCITED = 1e-2
"""A line counts as excited above this share of the strongest line of the same input."""


def periodic_ones(experiments: Sequence[Experiment]) -> tuple[list[Experiment], tuple[str, ...]]:
    """Check the periodic experiments; return those with the commonest period, and notes on the others.

    Experiments that are not declared periodic are left out without a note. Raises `IdentificationError` if none is, or if an
    experiment is declared periodic but is not (`check_periodic`).
    """
    claimed = [experiment for experiment in experiments if experiment.period_samples]
    if not claimed:
        raise IdentificationError(
            "none is periodic, which the best linear approximation needs; add multisine periods "
            "(period_samples), or give a linear model to begin from",
            field="experiments",
        )
    for index, experiment in enumerate(claimed):
        check_periodic(experiment, experiment.name or f"periodic one number {index + 1}")
    samples: Counter[int] = Counter()
    for experiment in claimed:
        samples[experiment.period_samples] += experiment.counted
    period = max(samples, key=lambda size: (samples[size], size))
    left = len(claimed) - sum(experiment.period_samples == period for experiment in claimed)
    notes = [f"periodic experiments left out: {left} of other periods than {period} samples"] if left else []
    return [experiment for experiment in claimed if experiment.period_samples == period], tuple(notes)


def check_periodic(experiment: Experiment, name: str) -> None:
    """Raise `IdentificationError` unless the counted periods, and the samples just before them, repeat.

    Two neighbouring periods may differ by 0.3 of the signal (RMS, mean removed) in every channel. The last
    1/32 of a period before the counted part must be as close to the same part one period later: the transient has decayed.
    """
    n, begin = experiment.period_samples, experiment.counted_from
    channels = (*experiment.input_channels, *experiment.output_channels)
    for channel, signal in zip(channels, np.vstack([experiment.inputs, experiment.outputs]), strict=True):
        counted = signal[begin:].reshape(-1, n)
        size = float(np.std(counted))
        if size == 0.0:
            continue
        if len(counted) > 1:
            difference = np.sqrt(np.mean(np.diff(counted, axis=0) ** 2, axis=1)) / size
            worst = int(np.argmax(difference))
            if difference[worst] > _DIFFERENCE:
                raise IdentificationError(
                    f"experiment '{name}', channel '{channel.name}': periods {worst + 1} and {worst + 2} of {n} samples "
                    f"differ by {difference[worst]:.2g} of the signal's RMS, allowed is {_DIFFERENCE:g}; count later, "
                    "settled periods, check period_samples, or set it to 0 (not periodic)"
                )
        reach = min(begin, max(n // _SETTLED_PART, 1))
        if reach:
            off = float(np.sqrt(np.mean((signal[begin - reach : begin] - counted[0, n - reach :]) ** 2))) / size
            if off > _DIFFERENCE:
                raise IdentificationError(
                    f"experiment '{name}', channel '{channel.name}': the {reach} samples before sample {begin}, where "
                    f"counting begins, differ from those a period later by {off:.2g} of the signal's RMS, allowed is "
                    f"{_DIFFERENCE:g}; count from a settled period, put a repeat of the period ahead "
                    "(Experiment.periodic), or set period_samples to 0 (not periodic)"
                )


def best_linear_responses(
    experiments: Sequence[Experiment], *, band_hz: tuple[float, float] | None = None
) -> FrequencyResponseMatrix:
    """Estimate ``H = sum_r Y_r U_r^H (sum_r U_r U_r^H)^-1`` of the periodic experiments, with its covariance.

    Every experiment is a realisation, averaged over its counted periods. Levels may be mixed: each experiment counts with its
    power and its weight, as in the fit over time. For the responses of one level, pass only the experiments of that level.
    Experiments that are not periodic are ignored.

    Raises `IdentificationError` if no experiment is periodic, one is declared periodic but is not, there are fewer
    realisations than inputs, inputs are linearly dependent, or no line is excited.

    Parameters
    ----------
    experiments
        Experiments with the same channels, at least one of them periodic. With several inputs, at least as many periodic ones
        as inputs; the experiments of one block (orthogonal multisines) follow each other.
    band_hz
        Lowest and highest line; if None, the excited band of the experiments, or all lines below half the sample rate if that
        is unknown. Within the band a line counts as excited if every input has at least a hundredth of the amplitude of its
        strongest line.

    Returns
    -------
    FrequencyResponseMatrix
        Responses at the excited lines. The total covariance needs two realisations per input, the noise covariance two
        periods; the notes name a covariance that is unknown.
    """
    same_channels(experiments)
    chosen, notes = periodic_ones(experiments)
    first = chosen[0]
    inputs, outputs = first.input_channels, first.output_channels
    if len(chosen) < len(inputs):
        raise IdentificationError(
            f"{len(chosen)} periodic for {len(inputs)} inputs",
            field="experiments",
            allowed="one for each at least, with other phases at every input",
        )
    extra = len(chosen) % len(inputs)
    if extra:
        notes = (*notes, f"last {extra} of {len(chosen)} realisations left out: blocks are of {len(inputs)}")
        chosen = chosen[: len(chosen) - extra]
    spectra = _spectra(chosen)
    frequency_hz = np.arange(spectra.shape[-1]) * first.sample_rate_hz / first.period_samples
    lines = _excited(spectra[:, :, : len(inputs)], frequency_hz, band_hz or excited_band(chosen))
    # Any channel may be an input or an output here: these roles serve only the estimate.
    roles = [Channel(f"input {i + 1}", "force", "N") for i in range(len(inputs))]
    roles += [Channel(f"output {o + 1}", "response", "m") for o in range(len(outputs))]
    found = best_linear_approximation(
        PeriodicSpectra(
            channels=tuple(roles),
            frequency_hz=frequency_hz[lines],
            excited=np.ones(np.count_nonzero(lines), dtype=np.bool_),
            spectra=spectra[..., lines],
        ),
        estimator="H1",
    )
    if len(chosen) < 2 * len(inputs):
        notes = (*notes, "too few realisations for a covariance with nonlinear distortion")
    return replace(
        found,
        inputs=inputs,
        outputs=outputs,
        specimen=first.specimen,
        notes=(*notes, *found.notes),
    )


def _spectra(experiments: Sequence[Experiment]) -> Complex:
    """complex[n_realisations, n_periods, n_inputs + n_outputs, n_lines], peak amplitudes times the root of the weight.

    If experiments have different numbers of periods, the last periods of each are used.
    """
    n = experiments[0].period_samples
    periods = min(experiment.counted // n for experiment in experiments)
    found = []
    for experiment in experiments:
        signals = np.vstack([experiment.counted_inputs, experiment.counted_outputs])[:, -periods * n :]
        lines = np.fft.rfft(signals.reshape(len(signals), periods, n), axis=-1) * (2.0 / n)
        found.append(np.sqrt(experiment.weight) * np.moveaxis(lines, 0, 1))
    return np.array(found)


def _excited(
    inputs: Complex, frequency_hz: NDArray[np.float64], band_hz: tuple[float, float] | None
) -> NDArray[np.bool_]:
    """bool[n_lines]: excited lines of complex[n_realisations, n_periods, n_inputs, n_lines], not 0 Hz nor half the rate."""
    inner = (np.arange(frequency_hz.size) > 0) & (frequency_hz < frequency_hz[-1] * (1.0 - 1e-9))
    if band_hz is not None:
        lowest, highest = band_hz
        if not 0.0 <= lowest < highest:
            raise IdentificationError(
                f"is {lowest:g} to {highest:g}", field="band_hz", allowed="two rising values from zero on"
            )
        inner &= (frequency_hz >= lowest * (1.0 - 1e-9)) & (frequency_hz <= highest * (1.0 + 1e-9))
    if not inner.any():
        raise IdentificationError(
            f"no line in {band_hz}, they are {frequency_hz[1]:g} Hz apart up to {frequency_hz[-1]:g} Hz",
            field="band_hz",
        )
    amplitude = np.sqrt(np.mean(np.abs(inputs.mean(axis=1)) ** 2, axis=0)) * inner
    largest = amplitude.max(axis=1)
    if np.any(largest == 0.0):
        raise IdentificationError(
            f"input {int(np.argmin(largest)) + 1} is zero at all lines (dead channel)", field="inputs"
        )
    lines = np.all(amplitude >= _EXCITED * largest[:, None], axis=0)
    IdentificationError.raise_if(
        not lines.any(), "no line is excited at all of them", field="inputs", hint="excite them at the same lines"
    )
    return np.asarray(lines)
