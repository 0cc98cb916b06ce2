"""The shifts of one run that a model needs to follow its measurements, by Gauss-Newton steps."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.models.simulated_runs import run_of
from identification.scatter.shifts import Effect, Scattered, shifted
from vibrolock.arrays import Float

_STEP = 1e-5
"""Step of the central differences by the shifts."""
_STEPS, _HALVINGS = 6, 5
"""Gauss-Newton steps for the shifts of a run, and halvings of a step that does not lower the residual, at most. Chosen."""
_ENOUGH = 0.02
"""Steps below this share of a standard error end the search."""
_LOOSE = 0.3
"""Standard deviation of a weak distribution of all shifts, so that a mode which the run does not show keeps its place."""


class OwnShift(NamedTuple):
    """Shifts of a run."""

    shift: Float
    """float[n_effects]."""
    variance: Float
    """float[n_effects], as if the residual were white."""
    visible: Float
    """float[n_effects], shift that changes the outputs by as much as the misfit."""


def own_shift(
    model: Scattered, effects: Sequence[Effect], experiments: Sequence[Experiment], scale: Float, begin: Float
) -> OwnShift:
    """Return the shifts with the least squared errors in the experiments of a run, outputs relative to ``scale``.

    ``begin`` (float[n_effects]) is where the search begins. A step that does not lower the errors is halved.
    """

    def residual(shift: Float) -> Float:
        try:
            return _residual(shifted(model, effects, shift), experiments, scale)
        except IdentificationError:  # no such model: a frequency above half the rate of the steps
            return np.full(sum(one.counted_outputs.size for one in experiments), 1e100)

    at = np.array(begin, dtype=np.float64)
    error, variance = residual(at), np.zeros(at.size)
    for _ in range(_STEPS):
        jacobian = np.empty((error.size, at.size))
        for k in range(at.size):
            move = _STEP * np.eye(at.size)[k]
            jacobian[:, k] = (residual(at + move) - residual(at - move)) / (2.0 * _STEP)
        noise = float(error @ error) / max(error.size - at.size, 1)
        normal = jacobian.T @ jacobian + noise / _LOOSE**2 * np.eye(at.size)
        inverse = np.linalg.inv(normal)
        variance = noise * np.diag(inverse)
        step = -inverse @ (jacobian.T @ error + noise / _LOOSE**2 * at)
        for _ in range(_HALVINGS):
            tried = residual(at + step)
            if tried @ tried < error @ error:
                at, error = at + step, tried
                break
            step = 0.5 * step
        else:
            break
        if np.all(np.abs(step) < _ENOUGH * np.sqrt(variance)):
            break
    return OwnShift(at, variance, np.sqrt(error.size * variance))


def _residual(model: Scattered, experiments: Sequence[Experiment], scale: Float) -> Float:
    parts = [
        np.sqrt(one.weight)
        * ((run_of(model, one).outputs[:, one.counted_from :] - one.counted_outputs) / scale[:, None])
        for one in experiments
    ]
    rows = np.concatenate([part.ravel() for part in parts])
    return rows if np.all(np.isfinite(rows)) else np.full(rows.size, 1e100)
