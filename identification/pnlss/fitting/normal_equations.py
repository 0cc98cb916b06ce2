"""Normal equations of all parameters, summed block by block, so that memory does not grow with the number of samples.

J denotes the derivatives of the weighted errors with respect to the shared parameters, Q the rows q = (x, u, chi). The own
parameters of output l have the Jacobian ``w_l Q``, so that only ``J_l' Q`` and ``Q' Q`` are needed, never the columns
themselves.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from identification.pnlss.fitting.frequency_lines import transformed
from identification.pnlss.fitting.kernels import sensitivities
from identification.pnlss.fitting.layout import System, room
from identification.pnlss.fitting.parameters import Parameters, slopes_of
from identification.pnlss.fitting.records import BOUND, Record

__all__ = ["BLOCK", "Blocks", "NormalEquations", "jacobian", "kept_samples", "normal_equations"]

Float = NDArray[np.float64]

BLOCK = 256
"""Samples per block: few enough for its Jacobian to stay in the cache between the recursion and the products."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations with ``H = J' J`` (float[n, n]) and ``g = J' r`` (float[n]) of weighted errors r."""

    hessian: Float
    gradient: Float


def kept_samples(samples: int, every: int) -> NDArray[np.int64]:
    """Return indices of one sample in every ``every``, at positions that follow the golden ratio.

    A fixed stride would sample a vibration whose period is a few strides always at the same few phases, and miss part of its
    harmonics.
    """
    begins = np.arange(0, samples, every)
    widths = np.minimum(every, samples - begins)
    return np.asarray(begins + np.floor(widths * (_GOLDEN * np.arange(begins.size) % 1.0)), dtype=np.int64)


class Blocks:
    """Iterator over the blocks of an experiment.

    It yields the Jacobian float[n_outputs, n, n_columns] and rows float[n, n_own] at one counted sample in every ``every``,
    and the weighted errors float[n_errors, n_outputs] of all counted samples. Arrays are reused. After the iteration the
    products of derivatives and errors are complete. Iteration ends early, with NaN, if the run is unbounded.
    """

    def __init__(
        self, parameters: Parameters, system: System, record: Record, begin: Float, weights: Float, every: int = 1
    ) -> None:
        n = system.state.shape[0]
        self._system, self._record, self._weights, self._every = system, record, weights, every
        self._linear, self._slopes = parameters.linear, slopes_of(system)
        self._room = room(system, self._slopes, parameters.ends[1] + (0 if record.place is None else n))
        self._room.x[:] = begin
        if record.place is not None:
            self._room.s[0, :, parameters.ends[1] :] = np.eye(n)

    @property
    def gradient(self) -> Float:
        """float[n_columns]: gradient with respect to the parameters that outputs share."""
        return self._room.gradient

    @property
    def own_gradient(self) -> Float:
        """float[n_outputs, n_own]: gradient with respect to the own parameters of each output."""
        return self._room.own_gradient

    def __iter__(self) -> Iterator[tuple[Float, Float, Float]]:
        """Yield the blocks; possible only once."""
        record, every, outputs = self._record, self._every, len(self._weights)
        edges = [*range(0, record.counted_from, BLOCK * every), *_edges(record, BLOCK * every), len(record.u)]
        columns, own = self.gradient.size, self.own_gradient.shape[1]
        samples = kept_samples(0, every)
        into = np.zeros((outputs, 0, columns)), np.zeros((0, own)), np.zeros((0, outputs))
        for begin, end in pairwise(edges):
            counted = begin >= record.counted_from
            if counted and end - begin != len(into[2]):
                samples = kept_samples(end - begin, every)
                n = samples.size
                into = np.zeros((outputs, n, columns)), np.zeros((n, own)), np.zeros((end - begin, outputs))
            u, y = record.u[begin:end], record.y[begin:end]
            how = (BOUND, self._weights, self._linear, counted, samples)
            if sensitivities(self._system, self._slopes, u, y, *how, self._room, *into) < end - begin:
                into[0][:] = np.nan
                self.gradient[:] = np.nan
                yield into
                return
            if counted:
                yield into


def _edges(record: Record, size: int) -> Iterator[int]:
    """First sample of each block. Blocks hold only samples that enter the fit; no block extends into the next period."""
    period = record.period or len(record.u)
    for begin in range(record.counted_from, len(record.u), period):
        yield from range(begin, min(begin + period, len(record.u)), size)


class _Sums:
    """Products summed over the blocks of one experiment; only the upper half of symmetric ones."""

    def __init__(self, columns: int, own: int, outputs: int) -> None:
        self.shared = np.zeros((columns, columns), order="F")
        self.mixed = [np.zeros((columns, own), order="F") for _ in range(outputs)]
        self.own = [np.zeros((own, own), order="F")] * outputs
        self.gradient = np.zeros(columns)
        self.own_gradient = np.zeros((outputs, own))

    def add(self, blocks: Blocks, every: int) -> None:
        """Add all blocks in time, where rows are the same for all outputs."""
        for jacobian, rows, _ in blocks:
            scipy.linalg.blas.dsyrk(
                every, jacobian.reshape(-1, jacobian.shape[2]).T, beta=1.0, c=self.shared, overwrite_c=1
            )
            for mine, into in zip(jacobian, self.mixed, strict=True):
                scipy.linalg.blas.dgemm(every, mine.T, rows.T, beta=1.0, c=into, trans_b=1, overwrite_c=1)
            scipy.linalg.blas.dsyrk(every, rows.T, beta=1.0, c=self.own[0], overwrite_c=1)
        self.gradient, self.own_gradient = blocks.gradient, blocks.own_gradient

    def add_lines(self, record: Record, lines: Float, blocks: Blocks, weights: Float) -> None:
        """Add all frequency lines."""
        for output, (jacobian, rows, errors) in enumerate(transformed(record, lines, blocks)):
            self.shared += jacobian.T @ jacobian
            self.mixed[output] = jacobian.T @ rows
            self.own[output] = rows.T @ rows
            self.gradient += jacobian.T @ errors[:, output]
            self.own_gradient[output] = weights[output] * rows.T @ errors[:, output]


def normal_equations(
    parameters: Parameters, vector: Float, records: list[Record], weights: Float, every: int = 1
) -> NormalEquations:
    """Sum the normal equations over all experiments at ``vector``.

    Errors are weighted by output (``weights``, float[n_outputs]) and by the weights of each record. The gradient uses all
    samples; the Hessian uses one in every ``every``, except for errors by frequency line. The result is not finite if a run
    is unbounded.
    """
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    hessian, gradient = np.zeros((parameters.count, parameters.count)), np.zeros(parameters.count)
    outputs, own = system.output.shape
    for record in records:
        begin = np.zeros(system.state.shape[0]) if record.place is None else begins[record.place]
        places = parameters.columns(record.place)
        sums = _Sums(len(places), own, outputs)
        if record.lines is None:
            sums.add(Blocks(parameters, system, record, begin, weights, every), every)
        else:
            sums.add_lines(record, record.lines, Blocks(parameters, system, record, begin, weights), weights)
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
    """Add the products of an experiment at the places of its parameters."""
    hessian[np.ix_(places, places)] += weight * _whole(sums.shared)
    gradient[places] += weight * sums.gradient
    for output, (mixed, by, own) in enumerate(zip(sums.mixed, weights, sums.own, strict=True)):
        mine = parameters.own(output)
        hessian[places, mine] += weight * by * mixed
        hessian[mine, places] += weight * by * mixed.T
        hessian[mine, mine] += weight * by**2 * _whole(own)
        gradient[mine] += weight * sums.own_gradient[output]


def _whole(upper: Float) -> Float:
    """Return a symmetric matrix from its upper half."""
    return np.asarray(np.triu(upper) + np.triu(upper, 1).T)


def jacobian(parameters: Parameters, vector: Float, record: Record, weights: Float) -> Float:
    """float[n_outputs, counted, n_parameters]: full Jacobian of one experiment in time, for small problems and checks."""
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    begin = np.zeros(system.state.shape[0]) if record.place is None else begins[record.place]
    places = parameters.columns(record.place)
    whole = np.zeros((len(weights), len(record.u) - record.counted_from, parameters.count))
    at = 0
    for filled, rows, _ in Blocks(parameters, system, record, begin, weights):
        part = whole[:, at : at + len(rows)]
        part[:, :, places] = filled
        for output, by in enumerate(weights):
            part[output, :, parameters.own(output)] = by * rows
        at += len(rows)
    return whole
