"""Initial states of experiments from their first samples."""

from dataclasses import replace

import numpy as np

from identification.models.pnlss.fitting.blocks import Blocks
from identification.models.pnlss.fitting.layout import System
from identification.models.pnlss.fitting.records import Record, simulated
from vibrolock.arrays import Float

SAMPLES = 600
"""Number of samples from which an initial state is estimated: a few decay times of lightly damped structures at usual rates."""
PRIOR = 1e-6
"""Weight of the squared initial state (states of unit RMS) relative to the squared errors (outputs of unit RMS).

It matters only for unobservable states.
"""
_ITERATIONS = 20


def fitted_initial_state(system: System, record: Record, weights: Float, samples: int = SAMPLES) -> Float:
    """Fit the initial state, float[n_states], to the first ``samples`` counted outputs by Levenberg-Marquardt from rest.

    The result is rest if the run from rest is unbounded.
    """
    n, end = len(system.state), min(record.counted_from + samples, len(record.u))
    first, u, y = record.counted_from, record.u[:end], record.y[:end]

    def error(x: Float) -> float:
        run = simulated(system, u, x)
        with np.errstate(over="ignore", invalid="ignore"):
            return (
                float(np.inf) if run is None else float(np.sum((weights * (run[1] - y)[first:]) ** 2) + PRIOR * x @ x)
            )

    x, damping = np.zeros(n), 1e-6
    best = error(x)
    for _ in range(_ITERATIONS):
        products, gradient = PRIOR * np.eye(n), PRIOR * x
        blocks = Blocks(system, replace(record, lines=None), weights, x, (0, end), "state")
        with np.errstate(over="ignore", invalid="ignore"):
            for bounded in blocks:
                rows = blocks.rows[:, n:].reshape(-1, blocks.columns) * (1.0 if bounded else np.nan)
                products += rows[:, :n].T @ rows[:, :n]
                gradient += rows[:, :n].T @ rows[:, -1]
        if not np.all(np.isfinite(products)):
            break
        values, vectors = np.linalg.eigh(products)
        along = vectors.T @ gradient
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
