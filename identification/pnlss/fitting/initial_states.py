"""The initial state of a run, from its first samples."""

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.fitting.kernels import sensitivities
from identification.pnlss.fitting.layout import System, room
from identification.pnlss.fitting.records import BOUND, Record, simulated
from identification.pnlss.fitting.slopes import slopes_of

__all__ = ["PRIOR", "SAMPLES", "fitted_initial_state"]

Float = NDArray[np.float64]

SAMPLES = 600
"""Samples from which an initial state is estimated: some decay times of lightly damped structures, as they are sampled."""
PRIOR = 1e-6
"""Share of the squares of an initial state, in states of unit RMS, beside the squared errors of outputs of unit RMS: nothing,
unless the outputs do not tell of a state at all."""
_ITERATIONS = 20


def fitted_initial_state(system: System, record: Record, weights: Float, samples: int = SAMPLES) -> Float:
    """float[n_states] that fits the first ``samples`` counted outputs best, by least squares (Levenberg-Marquardt) from rest.

    Rest, where the run from there leaves all bounds.
    """
    n, outputs = len(system.state), len(weights)
    first, end = record.counted_from, min(record.counted_from + samples, len(record.u))
    u, y = record.u[:end], record.y[:end]
    jacobian = np.zeros((outputs, end - first, n + system.output_table.weights.size))
    rows, errors = np.zeros((end - first, system.output.shape[1])), np.zeros((end - first, outputs))

    def error(x: Float) -> float:
        run = simulated(system, u, x)
        with np.errstate(over="ignore", invalid="ignore"):
            return (
                float(np.inf) if run is None else float(np.sum((weights * (run[1] - y)[first:]) ** 2) + PRIOR * x @ x)
            )

    slopes, none, all_samples = slopes_of(system), np.arange(0), np.arange(end - first)
    into = (jacobian, rows, errors)
    x, damping = np.zeros(n), 1e-6
    best = error(x)
    for _ in range(_ITERATIONS):
        r = room(system, slopes, n)
        r.x[:] = x
        r.s[0] = np.eye(n)
        done = sensitivities(system, slopes, u[:first], y[:first], BOUND, weights, 0, False, none, r, *into)
        done += sensitivities(system, slopes, u[first:], y[first:], BOUND, weights, 0, True, all_samples, r, *into)
        stacked = jacobian[:, :, :n].reshape(-1, n)
        if done < end or not np.all(np.isfinite(stacked)):
            break
        values, vectors = np.linalg.eigh(stacked.T @ stacked + PRIOR * np.eye(n))
        along = vectors.T @ (stacked.T @ errors.T.ravel() + PRIOR * x)
        before = best
        while damping < 1e6:
            step = -vectors @ (along / (values + damping * values[-1]))
            tried = error(x + step)
            if tried < best:
                x, best, damping = x + step, tried, damping / 100.0
                break
            damping *= 10.0
        if best > before * (1.0 - 1e-10):
            break
    return x
