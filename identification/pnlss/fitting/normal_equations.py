"""Normal equations of all parameters, gathered block by block: what a fit holds does not grow with the samples.

With J the derivatives of the weighted errors by the shared parameters and Q the rows q = (x, u, chi), the own parameters of
output l have the Jacobian ``w_l Q``: of those parts only ``J_l' Q`` and ``Q' Q`` are needed, never the columns themselves.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dgemm, dsyrk

from identification.pnlss.fitting.frequency_lines import transformed
from identification.pnlss.fitting.kernels import System, room, sensitivities
from identification.pnlss.fitting.parameters import Parameters
from identification.pnlss.fitting.records import BOUND, Record
from identification.pnlss.fitting.slopes import slopes_of

__all__ = ["NormalEquations", "blocks", "jacobian", "normal_equations"]

Float = NDArray[np.float64]
Blocks = Iterator[tuple[Float, Float]]

BLOCK = 512
"""Samples of a block: its Jacobian stays in the cache between the recursion and the products."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """``H = J' J`` (float[n, n]) and ``g = J' r`` (float[n]) of weighted errors r."""

    hessian: Float
    gradient: Float


def blocks(
    parameters: Parameters, system: System, record: Record, initial_state: Float, weights: Float, size: int = BLOCK
) -> Blocks:
    """Jacobian float[n_outputs, n, n_columns] and rows float[n, n_own + n_outputs] of the counted samples, block by block.

    The arrays are used again for the next block. Ends early, with NaN, where the run leaves all bounds.
    """
    n, outputs = system.state.shape[0], len(weights)
    recursion = parameters.ends[1] + (0 if record.place is None else n)
    inner = parameters.ends[2] - parameters.ends[1]
    slopes = slopes_of(system)
    r = room(system, slopes, recursion)
    r.x[:] = initial_state
    if record.place is not None:
        r.s[0, :, parameters.ends[1] :] = np.eye(n)
    filled = np.zeros((outputs, size, recursion + inner))
    rows = np.zeros((size, system.output.shape[1] + outputs))
    edges = [*range(0, record.counted_from, size), *_period_edges(record, size), len(record.u)]
    for begin, end in pairwise(edges):
        counted = begin >= record.counted_from
        if end - begin != filled.shape[1] and counted:
            filled, rows = np.zeros((outputs, end - begin, filled.shape[2])), np.zeros((end - begin, rows.shape[1]))
        u, y = record.u[begin:end], record.y[begin:end]
        done = sensitivities(system, slopes, u, y, BOUND, weights, parameters.linear, counted, r, filled, rows)
        if done < end - begin:
            filled[:] = np.nan
            yield filled, rows
            return
        if counted:
            yield filled, rows


def _period_edges(record: Record, size: int) -> Iterator[int]:
    """Where blocks of counted samples begin; none goes on into the next period."""
    period = record.period or len(record.u)
    for begin in range(record.counted_from, len(record.u), period):
        yield from range(begin, min(begin + period, len(record.u)), size)


class _Sums:
    """Products of the blocks of one experiment."""

    def __init__(self, columns: int, own: int, outputs: int) -> None:
        self.shared = np.zeros((columns, columns), order="F")
        self.mixed = [np.zeros((columns, own + outputs), order="F") for _ in range(outputs)]
        self.rows = np.zeros((own + outputs, own + outputs), order="F")
        self.rows_of = [self.rows] * outputs

    def add(self, filled: Float, rows: Float) -> None:
        """One block in time: rows are the same for all outputs."""
        flat = filled.reshape(-1, filled.shape[2]).T
        dsyrk(1.0, flat, beta=1.0, c=self.shared, overwrite_c=1)
        for mine, into in zip(filled, self.mixed, strict=True):
            dgemm(1.0, mine.T, rows.T, beta=1.0, c=into, trans_b=1, overwrite_c=1)
        dsyrk(1.0, rows.T, beta=1.0, c=self.rows, overwrite_c=1)

    def set_lines(self, output: int, lines: Float, rows: Float) -> None:
        """All frequency lines of one output, real parts above imaginary ones."""
        self.shared += np.triu(lines.T @ lines)
        self.mixed[output] = lines.T @ rows
        self.rows_of[output] = np.triu(rows.T @ rows)


def normal_equations(parameters: Parameters, vector: Float, records: list[Record], weights: Float) -> NormalEquations:
    """Of all experiments at ``vector``, errors weighted by output (float[n_outputs]) and as each record says.

    Not finite where a run leaves all bounds.
    """
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    hessian, gradient = np.zeros((parameters.count, parameters.count)), np.zeros(parameters.count)
    outputs, own = system.output.shape
    for record in records:
        begin = np.zeros(system.state.shape[0]) if record.place is None else begins[record.place]
        places = parameters.columns(record.place)
        sums = _Sums(len(places), own, outputs)
        parts = blocks(parameters, system, record, begin, weights)
        if record.lines is None:
            for filled, rows in parts:
                sums.add(filled, rows)
        else:
            for output, (lines, rows) in enumerate(transformed(record, record.lines, parts)):
                sums.set_lines(output, lines, rows)
        _scatter(parameters, record.weight, places, weights, sums, hessian, gradient)
    return NormalEquations(hessian, gradient)


def _scatter(
    parameters: Parameters,
    weight: float,
    places: NDArray[np.int64],
    weights: Float,
    sums: _Sums,
    hessian: Float,
    gradient: Float,
) -> None:
    """Put the products of an experiment where its parameters stand."""
    shared = np.triu(sums.shared)
    hessian[np.ix_(places, places)] += weight * (shared + np.triu(shared, 1).T)
    own = parameters.own(0).stop - parameters.own(0).start
    for output, (mixed, by, upper) in enumerate(zip(sums.mixed, weights, sums.rows_of, strict=True)):
        mine = parameters.own(output)
        rows = np.triu(upper)[:own, :own]
        cross = weight * by * mixed[:, :own]
        hessian[places, mine] += cross
        hessian[mine, places] += cross.T
        hessian[mine, mine] += weight * by**2 * (rows + np.triu(rows, 1).T)
        gradient[places] += weight * mixed[:, own + output]
        gradient[mine] += weight * by * upper[:own, own + output]


def jacobian(parameters: Parameters, vector: Float, record: Record, weights: Float) -> Float:
    """float[n_outputs, counted, n_parameters] of one experiment in time, all columns: for small problems and checks."""
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    begin = np.zeros(system.state.shape[0]) if record.place is None else begins[record.place]
    places, own = parameters.columns(record.place), system.output.shape[1]
    whole = np.zeros((len(weights), len(record.u) - record.counted_from, parameters.count))
    at = 0
    for filled, rows in blocks(parameters, system, record, begin, weights):
        part = whole[:, at : at + len(rows)]
        part[:, :, places] = filled
        for output, by in enumerate(weights):
            part[output, :, parameters.own(output)] = by * rows[:, :own]
        at += len(rows)
    return whole
