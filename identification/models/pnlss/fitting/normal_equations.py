"""Normal equations of all parameters over all experiments.

The samples are cut into as many pieces as there are threads. The state at the begin of a piece counts as a parameter of the
piece; by its derivatives, which are the sensitivities at the end of the piece before, the pieces are joined.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.models.pnlss.fitting.blocks import Blocks, Derivatives
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import Record
from identification.models.pnlss.fitting.sums import Sums, summed
from vibrolock.arrays import Float

Piece = tuple[Record, tuple[int, int]]

_SHORTEST = 1000
"""Number of samples below which a piece is not worth a thread."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations with ``H = J' J`` (float[n, n]) and ``g = J' r`` (float[n]) of weighted errors r."""

    hessian: Float
    gradient: Float


def normal_equations(
    parameters: Parameters, vector: Float, records: list[Record], weights: Float, threads: int = 1
) -> NormalEquations:
    """Sum the normal equations over all experiments at ``vector``.

    Errors are weighted by output (``weights``, float[n_outputs]) and by the weights of each record. The result is not finite
    if a run is unbounded. With several ``threads``, the linear algebra must keep to one.
    """
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    hessian, gradient = np.zeros((parameters.count, parameters.count)), np.zeros(parameters.count)
    shared, derivatives = slice(parameters.shared), np.zeros(())

    def of(piece: Piece) -> Sums | None:
        record, span = piece
        x = np.zeros(parameters.start.states) if record.place is None else begins[record.place]
        return summed(system, record, x, weights, span)

    with ThreadPoolExecutor(threads) as pool:
        pieces = [(record, span) for record in records for span in _spans(record, -(-threads // len(records)))]
        for (record, span), sums in zip(pieces, pool.map(of, pieces) if threads > 1 else map(of, pieces), strict=True):
            if sums is None:
                return NormalEquations(np.full_like(hessian, np.nan), np.full_like(gradient, np.nan))
            onto = parameters.onto(derivatives if span[0] else parameters.begin_derivatives(record.place))
            derivatives = sums.after @ onto[: sums.after.shape[1]]
            whole = onto.T @ (np.triu(sums.shared) + np.triu(sums.shared, 1).T) @ onto
            hessian[shared, shared] += record.weight * whole[:-1, :-1]
            gradient[shared] += record.weight * whole[:-1, -1]
            for output, by in enumerate(weights):
                mine, mixed = parameters.own(output), record.weight * by * sums.mixed[:, output] @ onto
                hessian[mine, shared] += mixed[:, :-1]
                hessian[shared, mine] += mixed[:, :-1].T
                hessian[mine, mine] += record.weight * by**2 * sums.own[output % len(sums.own)]
                gradient[mine] += mixed[:, -1]
    return NormalEquations(hessian, gradient)


def _spans(record: Record, most: int) -> Iterator[tuple[int, int]]:
    """Yield the pieces of a record: its counted samples in equal parts, those before them with the first."""
    counted = len(record.u) - record.counted_from
    count = 1 if record.lines is not None else max(1, min(most, counted // _SHORTEST))
    edges = [0, *(record.counted_from + counted * i // count for i in range(1, count)), len(record.u)]
    yield from pairwise(edges)


def jacobian(parameters: Parameters, vector: Float, record: Record, weights: Float) -> Float:
    """float[n_outputs, counted, n_parameters]: full Jacobian of one experiment in time, for small problems and checks."""
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    n, own = len(system.state), system.output.shape[1]
    x, at = np.zeros(n) if record.place is None else begins[record.place], 0
    onto = parameters.onto(parameters.begin_derivatives(record.place))
    whole = np.zeros((len(weights), len(record.u) - record.counted_from, parameters.count))
    of: Derivatives = "parameters" if record.place is None else "all"
    blocks = Blocks(system, record, weights, x, (0, len(record.u)), of)
    for _ in blocks:
        part = whole[:, at : at + len(blocks.rows)]
        at += len(blocks.rows)
        part[:, :, : parameters.shared] = np.moveaxis(blocks.rows[:, n:] @ onto[:, :-1], 1, 0)
        for output, by in enumerate(weights):
            part[output, :, parameters.own(output)] = by * blocks.q[:, :own]
    return whole
