"""Experiments in the scaled units of a fit, their simulation, and initial states from their first samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.experiment import Experiment
from identification.pnlss.fitting.kernels import sensitivities
from identification.pnlss.fitting.layout import System, room
from identification.pnlss.fitting.parameters import matrices_of, slopes_of
from identification.pnlss.kernels import simulate, workspace

__all__ = ["BOUND", "PRIOR", "SAMPLES", "Record", "fitted_initial_state", "records_of", "simulated"]

Float = NDArray[np.float64]

BOUND = 1e6
"""A state is unbounded beyond this multiple of its RMS in the start."""
SAMPLES = 600
"""Number of samples from which an initial state is estimated: a few decay times of lightly damped structures at usual rates."""
PRIOR = 1e-6
"""Weight of the squared initial state (states of unit RMS) relative to the squared errors (outputs of unit RMS).

It matters only for unobservable states.
"""
_ITERATIONS = 20


@dataclass(frozen=True, eq=False)
class Record:
    """An experiment in scaled units: float[n, n_inputs], float[n, n_outputs], rows contiguous."""

    u: Float
    y: Float
    counted_from: int
    period: int
    weight: float
    place: int | None
    """Position among the experiments with an estimated initial state; None for a run from rest."""
    name: str
    """Name for messages."""
    lines: Float | None = None
    """float[n_outputs, n_lines], weights of the lines of a period; None if errors are taken over time."""

    def squares(self, errors: Float) -> Float:
        """float[n_outputs], sums of squares of the counted errors float[n, n_outputs], weighted by ``lines`` if given."""
        counted = errors[self.counted_from :]
        with np.errstate(over="ignore", invalid="ignore"):
            if self.lines is None:
                return np.asarray(np.einsum("ko,ko->o", counted, counted))
            folded = np.mean(counted.reshape(-1, self.period, counted.shape[1]), axis=0)
            return np.asarray(np.sum(np.abs(self.lines.T * np.fft.rfft(folded, axis=0)) ** 2, axis=0))


def records_of(
    experiments: Sequence[Experiment], inputs: Float, outputs: Float, kind: str = "experiments"
) -> list[Record]:
    """Convert experiments to records in the given scales."""
    found: list[Record] = []
    place = 0
    for index, experiment in enumerate(experiments):
        estimated = experiment.initial_state == "estimated"
        found.append(
            Record(
                np.ascontiguousarray((experiment.inputs / inputs[:, None]).T),
                np.ascontiguousarray((experiment.outputs / outputs[:, None]).T),
                experiment.counted_from,
                experiment.period_samples,
                experiment.weight,
                place if estimated else None,
                f"{kind}[{index}]{f' ({experiment.name})' if experiment.name else ''}",
            )
        )
        place += estimated
    return found


def simulated(system: System, u: Float, initial_state: Float) -> tuple[Float, Float] | None:
    """Return states and outputs, float[n, ...]; None if a run is unbounded."""
    m = matrices_of(system)
    x, y = np.empty((len(u), len(m.a))), np.empty((len(u), len(m.c)))
    bound = np.full(len(m.a), BOUND)
    begin = np.ascontiguousarray(initial_state)
    count = simulate(m, system.state_table, system.output_table, u, begin, bound, workspace(m), x, y)
    return (x, y) if count == len(u) and bool(np.all(np.isfinite(y))) else None


def fitted_initial_state(system: System, record: Record, weights: Float, samples: int = SAMPLES) -> Float:
    """Fit the initial state, float[n_states], to the first ``samples`` counted outputs by Levenberg-Marquardt from rest.

    The result is rest if the run from rest is unbounded.
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
