"""What a linear model leaves unexplained, as disturbances of its states: estimated states and disturbances from the outputs.

The measured outputs are explained by ``x(k+1) = A x + B u + w``, ``y = C x + D u + e`` with small w and e: a Kalman filter in
its steady state forward, a disturbance smoother back (Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed.,
2012, Section 4.5). Where the structure is nonlinear, w is what its nonlinearity does to the states, and can be compared with
features sample by sample, without any simulation: the inference step of inference and learning (Floren, Noel, Swevers,
Mechanical Systems and Signal Processing, 2025).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.models.pnlss.features import Features
from identification.models.pnlss.kernels import Matrices, simulate, workspace
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_NOISE_FLOOR = 1e-8
"""Smallest mean square of e, relative to that of the output."""
_SETTLING = 50
"""Samples at the end of a record that do not count: the smoother has no outputs after them."""


class Residual(NamedTuple):
    """Estimated states and what moves them beside the linear model, at the samples of all experiments that count."""

    variables: Float
    """float[n_states + n_inputs, n], states and inputs."""
    disturbance: Float
    """float[n_states, n], w."""
    misfit: Float
    """float[n_outputs, n], e."""
    weight: Float
    """float[n], weight of the experiment of each sample."""


def linear_residual(model: PnlssModel, experiments: Sequence[Experiment], mobility: float) -> Residual:
    """Return states, disturbances and misfits that explain the outputs of all experiments.

    Parameters
    ----------
    model
        A stable linear model.
    experiments
        Data.
    mobility
        Mean square of w relative to that of the state, where that of e is what the linear model alone leaves of the outputs.
        A larger one explains more of the outputs by disturbances.

    Raises
    ------
    IdentificationError
        If the filter of this model does not exist.
    """
    runs = [model.simulate(e.inputs) for e in experiments]
    counted = [slice(e.counted_from, None) for e in experiments]
    left = np.hstack([e.outputs[:, at] - r.outputs[:, at] for e, r, at in zip(experiments, runs, counted, strict=True)])
    size = np.mean(np.hstack([e.counted_outputs for e in experiments]) ** 2, axis=1)
    noise = np.diag(np.maximum(np.mean(left**2, axis=1), _NOISE_FLOOR * size))
    states = np.hstack([r.states[:, at] for r, at in zip(runs, counted, strict=True)])
    moved = mobility * np.diag(np.mean(states**2, axis=1))
    try:
        spread = scipy.linalg.solve_discrete_are(model.a.T, model.c.T, moved, noise)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise IdentificationError(f"its Kalman filter could not be computed ({error})", field="linear") from None
    parts = [_smoothed(model, e, moved, noise, np.asarray(spread, dtype=float)) for e in experiments]
    return Residual(*(np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True)))


def _smoothed(model: PnlssModel, experiment: Experiment, moved: Float, noise: Float, spread: Float) -> Residual:
    """Return the estimates for one experiment, given the mean squares of w, e and the error of the filter's state."""
    a, b, c, d = model.linear_part
    u, y = experiment.inputs, experiment.outputs
    innovation = c @ spread @ c.T + noise
    gain = np.linalg.solve(innovation, c @ spread @ a.T).T
    closed = a - gain @ c
    filtered = _states(closed, np.hstack([b - gain @ d, gain]), np.vstack([u, y]))
    pulled = c.T @ np.linalg.solve(innovation, y - c @ filtered - d @ u)
    # r(k) = pulled(k) + closed' r(k+1), zero after the end: the same recursion, with time reversed.
    after = _states(closed.T, np.eye(len(a)), pulled[:, ::-1])[:, ::-1]
    states = filtered + spread @ (pulled + closed.T @ after)
    end = max(u.shape[1] - _SETTLING, experiment.counted_from + 1)
    at = slice(experiment.counted_from, end)
    return Residual(
        np.vstack([states, u])[:, at],
        (moved @ after)[:, at],
        (y - c @ states - d @ u)[:, at],
        np.full(end - experiment.counted_from, experiment.weight),
    )


def _states(a: Float, b: Float, u: Float) -> Float:
    """float[n_states, n]: states of ``x(k+1) = a x + b u`` from rest."""
    n, m = b.shape
    none = Features.none(n, m).table
    nothing = np.zeros((0, 0))
    parts = a, b, np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, m)), nothing
    matrices = Matrices(*map(np.ascontiguousarray, parts))
    x, y = np.zeros((u.shape[1], n)), np.zeros((u.shape[1], 0))
    simulate(
        matrices, none, none, np.ascontiguousarray(u.T), np.zeros(n), np.full(n, np.inf), workspace(matrices), x, y
    )
    return np.asarray(x.T)
