"""Experiments as a fit works with them, and what a system makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.experiment import Experiment
from identification.pnlss.fitting.layout import System
from identification.pnlss.fitting.parameters import matrices_of
from identification.pnlss.kernels import simulate, workspace

__all__ = ["BOUND", "Record", "records_of", "simulated"]

Float = NDArray[np.float64]

BOUND = 1e6
"""States of so many times their RMS in the start are out of bounds."""


@dataclass(frozen=True, eq=False)
class Record:
    """An experiment in scaled units: float[n, n_inputs], float[n, n_outputs], rows contiguous."""

    u: Float
    y: Float
    counted_from: int
    period: int
    weight: float
    place: int | None
    """Among those with an estimated initial state; None for a run from rest."""
    name: str
    """For messages."""
    lines: Float | None = None
    """float[n_outputs, n_lines], weights of the lines of a period; None where errors are those over time."""

    def squares(self, errors: Float) -> Float:
        """float[n_outputs], sums of squares of errors float[n, n_outputs] where they count, weighted by lines if so asked."""
        counted = errors[self.counted_from :]
        with np.errstate(over="ignore", invalid="ignore"):
            if self.lines is None:
                return np.asarray(np.einsum("ko,ko->o", counted, counted))
            folded = np.mean(counted.reshape(-1, self.period, counted.shape[1]), axis=0)
            return np.asarray(np.sum(np.abs(self.lines.T * np.fft.rfft(folded, axis=0)) ** 2, axis=0))


def records_of(
    experiments: Sequence[Experiment], inputs: Float, outputs: Float, kind: str = "experiments"
) -> list[Record]:
    """Experiments over the given scales."""
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
    """States and outputs, float[n, ...]; None if they leave all bounds."""
    m = matrices_of(system)
    x, y = np.empty((len(u), len(m.a))), np.empty((len(u), len(m.c)))
    bound = np.full(len(m.a), BOUND)
    begin = np.ascontiguousarray(initial_state)
    count = simulate(m, system.state_table, system.output_table, u, begin, bound, workspace(m), x, y)
    return (x, y) if count == len(u) and bool(np.all(np.isfinite(y))) else None
