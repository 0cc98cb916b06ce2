"""What noise explains of the residual of a model."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from identification.experiments.experiment import Experiment
from vibrolock.arrays import Bool, Complex, Float

_EXCITED, _ABOVE_NOISE = 1e-2, 10.0
"""Amplitude of an excited line relative to the largest of its input, and to its standard error, at least. Chosen."""
_DRIVEN = 1e-6
"""Amplitude of a line relative to the RMS of its input, below which the input is constant. Chosen."""
_FEWEST_LINES = 20
"""Excited lines without which the residual is not held against the noise. With so many lines and two periods, noise alone
exceeds a ratio of 2 in fewer than one of ten thousand cases (F distribution with 40 and 40 degrees of freedom)."""


EXPLAINED = 3.0
"""Residual over noise up to which noise explains the residual. Chosen: right structures fitted at 0.1 % noise came to 2.5."""
SMALL = 2e-3
"""Relative error up to which a residual is called small. Chosen: every law that fits the virtual magnet beam leaves 0.08 %."""

UNSETTLED = 0.05
"""Standard error of the mean over periods, over the output, from which on a record is no settled vibration. Chosen: noise of
3 % has less, and a hardening structure that jumps from period to period 8 to 40 %."""


def lacks_something(over_noise: ArrayLike, error: ArrayLike) -> Bool:
    """Return whether a model lacks something or its fit ended in a local minimum, bool[n]: more than noise, and not small.

    ``over_noise`` is that of `residual_over_noise`, False where it is NaN; ``error`` is the relative RMS error, float[n].
    """
    return np.asarray((np.asarray(over_noise) > EXPLAINED) & (np.asarray(error) > SMALL))


def unsettled_share(experiment: Experiment) -> float:
    """Return the largest standard error of the mean over periods, over the output, in the excited lines; NaN if unknown.

    What force and output share does not count. Above `UNSETTLED` the periods differ by so much that their mean is no vibration
    of the structure: it has not settled, or does not repeat. A right model of it leaves any residual.
    """
    measured = experiment.counted_outputs
    noise = residual_and_noise(experiment, measured).noise
    if not np.isfinite(noise).all():
        return float("nan")
    y = _lines(measured, experiment)
    size = np.sum(np.abs(y[:, _in_band(experiment, y.shape[1])]) ** 2, axis=1)
    return float(np.sqrt(np.max(np.divide(noise, size, out=np.zeros(len(y)), where=size > 0.0))))


def unsettled(experiments: Iterable[Experiment]) -> tuple[str, ...]:
    """Return a remark on each record whose periods differ too much for its mean to be a vibration (`unsettled_share`)."""
    shares = [(one, unsettled_share(one)) for one in experiments]
    return tuple(
        f"{one.name}: the mean of its periods is known within {100.0 * share:.2g} % only: the vibration has not settled, does "
        "not repeat, or is buried in noise; whether the model is right cannot be told"
        for one, share in shares
        if share > UNSETTLED
    )


class ResidualAndNoise(NamedTuple):
    """Residual and noise of every output in the excited lines of a periodic record; NaN where the noise is unknown."""

    residual: Float
    """float[n], sums of the squared amplitudes of the residual."""
    noise: Float
    """float[n], the same of the noise."""
    lines: Float
    """float[n], lines of equal noise whose sum would scatter as much: ``(sum of squares)^2 / sum of fourth powers``."""


def log_likelihood_ratio(smaller: ResidualAndNoise, larger: ResidualAndNoise) -> float:
    """Return by how much the natural logarithm of the likelihood of a larger model exceeds that of a smaller one.

    The noise is that of the smaller model, normal and equal in all lines. Outputs count as if they shared one noise: their
    mean, which takes too little from independent ones. NaN where the noise is unknown.

    Parameters
    ----------
    smaller, larger
        Residuals of both on the same records, each float[n_records, n_outputs].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        found = smaller.lines * (smaller.residual - larger.residual) / smaller.noise
    known = np.isfinite(found).all(axis=1)
    return float(np.sum(np.mean(found[known], axis=1))) if known.any() else float("nan")


def residual_over_noise(experiment: Experiment, simulated: Float, of_steps: Float | None = None) -> Float:
    """Return the RMS of a model's residual over that of the noise, float[n_outputs], in the excited lines of a periodic record.

    The noise of a line is that of ``Y - G U``: outputs Y, inputs U and G, the response of the model from input to output in
    this line. Noise in the input counts, and noise that both share, such as that of a shaker, does not. A right model has a
    ratio near 1. Beyond 2 it misses more than noise explains.

    NaN where this is unknown: a record that is not periodic, without the scatter of its periods, with several inputs or with
    fewer than 20 excited lines. Not seen are errors beyond the excited lines, and what every period repeats, such as an error
    of a sensor's gain.

    Parameters
    ----------
    experiment
        The record.
    simulated
        float[n_outputs, counted], outputs of the model with its inputs.
    of_steps
        float[n_outputs, counted], what the steps of the simulation get wrong in them; it counts as noise. None for nothing.
    """
    found = residual_and_noise(experiment, simulated, of_steps)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(found.residual / found.noise)
    return np.where(found.noise > 0.0, ratio, np.nan)


def residual_and_noise(experiment: Experiment, simulated: Float, of_steps: Float | None = None) -> ResidualAndNoise:
    """Return both parts of `residual_over_noise`, of which the arguments are."""
    unknown = ResidualAndNoise(*np.full((3, len(experiment.outputs)), np.nan))
    covariance, inputs = experiment.noise_covariance, len(experiment.inputs)
    of_steps = np.zeros_like(simulated) if of_steps is None else of_steps
    if covariance is None or not experiment.period_samples or not np.isfinite(simulated + of_steps).all():
        return unknown
    u, y, z = (_lines(v, experiment) for v in (experiment.counted_inputs, experiment.counted_outputs, simulated))
    rms = np.sqrt(np.mean(experiment.counted_inputs**2, axis=1))
    driven = np.flatnonzero(np.abs(u).max(axis=1) > _DRIVEN * rms)  # a constant input is not
    if driven.size != 1:
        return unknown
    size, noise = np.abs(u[driven[0]]), np.sqrt(covariance[:, driven[0], driven[0]].real)
    excited = (size > _EXCITED * size.max()) & (size > _ABOVE_NOISE * noise) & _in_band(experiment, size.size)
    if np.count_nonzero(excited) < _FEWEST_LINES:
        return unknown
    weights = np.zeros((int(np.count_nonzero(excited)), len(y), inputs + len(y)), complex)
    weights[:, :, inputs:] = np.eye(len(y))
    weights[:, :, driven[0]] = -(z[:, excited] / u[driven[0], excited]).T
    power = np.einsum("kij,kjl,kil->ik", weights, covariance[excited], weights.conj()).real
    power += np.abs(_lines(of_steps, experiment)[:, excited]) ** 2
    noise, fourth = np.sum(power, axis=1), np.sum(power**2, axis=1)
    lines = np.divide(noise**2, fourth, out=np.full(len(y), np.nan), where=fourth > 0.0)
    return ResidualAndNoise(np.sum(np.abs(z - y)[:, excited] ** 2, axis=1), noise, lines)


def _lines(values: Float, experiment: Experiment) -> Complex:
    period = experiment.period_samples
    mean = values.reshape(len(values), -1, period).mean(axis=1)
    return np.asarray(np.fft.rfft(mean, axis=1)[:, 1 : (period + 1) // 2] * (2.0 / period))


def _in_band(experiment: Experiment, lines: int) -> np.ndarray:
    lowest, highest = experiment.excited_hz or (0.0, np.inf)
    hz = np.arange(1, lines + 1) * experiment.sample_rate_hz / experiment.period_samples
    half = 0.5 * experiment.sample_rate_hz / experiment.period_samples
    return np.asarray((hz > lowest - half) & (hz < highest + half))
