"""What is left of a transient in records that are called periodic, and what it does to the numbers of a model.

The mean over the periods less the last of them holds the difference of their transients. What the numbers of a model move by to
follow it, to first order, is by how much the transient moves them, but for what the last period still has.
"""

import numpy as np

from identification.experiments.experiment import Experiment
from vibrolock.arrays import Float

_EXCITED = 1e-2
"""Amplitude of an excited line relative to the largest, at least. Chosen."""
_CERTAIN = 0.99
"""Certainty with which a change of the periods is more than noise. Chosen."""


def own_change(experiment: Experiment, found: Float) -> Float:
    """float[counted, n_outputs]: change of the periods of the outputs that the change of the input does not explain.

    ``found`` float[counted, n_outputs] are the outputs of the model, whose response in each excited line is that to the input.
    """
    change = experiment.period_change
    rows = len(experiment.inputs) + len(experiment.outputs)
    if change is None or len(experiment.inputs) > 1 or len(change.values) != rows:
        return np.zeros_like(found)
    size = experiment.period_samples
    force, response, moved = (
        np.fft.rfft(values, axis=-1)
        for values in (experiment.counted_inputs[0, -size:], found[-size:].T, change.values[0])
    )
    excited = np.abs(force) > _EXCITED * np.abs(force).max()
    by_input = np.where(excited, response * moved / np.where(excited, force, 1.0), 0.0)
    own = change.values[1:] - np.fft.irfft(by_input, size, axis=-1)
    return np.asarray(np.tile(own.T, (len(found) // size, 1)))


def transient_factor(part: Float, change: Float, one: Experiment, slowest_1_s: float) -> float:
    """Return by what to multiply what a change of the periods moves, to have what the transient in their mean moves.

    ``part`` are the rows of the experiment: derivatives, errors of the steps and residuals; ``change`` is the column of what
    `own_change` returned. 0 where the change is no more than noise in what the numbers can explain.

    A transient of decay rate d leaves the fraction ``r = exp(-d T)`` of itself from one period T to the next; the mean over P
    periods holds ``m = (1 + r + ... + r^(P-1)) / P`` of it and the last one ``r^(P-1)``.
    """
    if one.period_change is None or not change.any():
        return 0.0
    from scipy.stats import chi2

    numbers, periods = part.shape[1] - 2, one.period_change.periods
    orthogonal, triangle = np.linalg.qr(part[:, :numbers])
    seen = np.abs(np.diag(triangle)) > 1e-12 * np.abs(np.diag(triangle)).max()
    energy = float(np.sum((orthogonal.T @ change)[seen] ** 2))
    noise = (periods - 1) * float(part[:, -1] @ part[:, -1]) / one.counted_outputs.size
    expected = noise * float(chi2.ppf(_CERTAIN, np.count_nonzero(seen)))
    if energy <= expected:
        return 0.0
    left = np.exp(-slowest_1_s * one.period_samples / one.sample_rate_hz) ** np.arange(periods)
    return float(np.mean(left) / (np.mean(left) - left[-1]))
