"""Experiments in the scaled units of a fit, and their simulation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identification.experiments.experiment import Experiment
from identification.models.pnlss.fitting.kernels import System, run
from vibrolock.arrays import Float

BOUND = 1e6
"""A state is unbounded beyond this multiple of its RMS in the start."""
_CHUNK = 1024
"""Samples simulated at a time."""


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
    x, y = np.empty((len(u), len(system.state))), np.empty((len(u), len(system.output)))
    for chunk, z, q in _chunks(system, u, np.array(initial_state)):
        x[chunk] = z[:, : x.shape[1]]
        with np.errstate(over="ignore", invalid="ignore"):
            y[chunk] = q @ system.output.T
        if chunk.stop == len(u):
            return (x, y) if bool(np.all(np.isfinite(y))) else None
    return None


def state_after(system: System, u: Float, initial_state: Float) -> Float:
    """float[n_states]: state after the last sample; not a number if a run is unbounded."""
    x, done = np.array(initial_state), 0
    for chunk, _, _ in _chunks(system, u, x):
        done = chunk.stop
    return x if done == len(u) else np.full_like(x, np.nan)


def _chunks(system: System, u: Float, x: Float) -> Iterator[tuple[slice, Float, Float]]:
    """Yield samples, (x, u, phi) and (x, u, chi), moving ``x`` on, until the end or the first chunk that is unbounded."""
    alike, size = system.alike, min(len(u), _CHUNK)
    z = np.empty((size, system.state.shape[1]))
    q = z if alike else np.empty((size, system.output.shape[1]))
    for begin in range(0, len(u), _CHUNK):
        chunk = slice(begin, min(begin + _CHUNK, len(u)))
        n = chunk.stop - begin
        if run(system, u[chunk], BOUND, x, alike, z, q) < n:
            return
        yield chunk, z[:n], q[:n]
