"""Normal equations of all parameters over all experiments.

The samples are cut into as many pieces as there are threads. The state at the begin of a piece counts as a parameter of the
piece; by its derivatives, which are the sensitivities at the end of the piece before, the pieces are joined.

J denotes the derivatives of the weighted errors with respect to the parameters that all outputs share, with the errors
themselves as its last column, so that J' J holds the gradient too. The own parameters of output l have the Jacobian ``w_l Q``
with the rows q = (x, u, chi), so that only ``Q' J_l`` and ``Q' Q`` are needed, never the columns themselves.

Most of J' J are the rows of [A B E]. Their sensitivities S of the state obey ``S(k+1) = A(k) S(k) + Z(k)``, where Z(k) has
z(k) in the columns of row i of [A B E] at state i, and zeros elsewhere. With the adjoint ``m(k) = C(k)' J(k) + A(k)' m(k+1)``
of a block that begins at sample b, zero after its end,

    sum of (C(k) S(k))' J(k)  =  S(b)' m(b)  +  sum of Z(k)' m(k+1),

and the products with Z are products of z with one row of m for each state. Their work does not grow with the number of
outputs: with four states and four outputs it is a third of that of J' J. With one output, J' J itself is less.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.models.pnlss.fitting.blocks import Blocks, Derivatives, even
from identification.models.pnlss.fitting.frequency_lines import transformed
from identification.models.pnlss.fitting.kernels import System, adjoint
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import Record, state_after
from vibrolock.arrays import Float

_WAITING = 32
"""Number of blocks after which the products ``S(b)' m(b)`` are added."""


class Sums:
    """Products summed over a piece of a record, in the columns of its `Blocks`."""

    def __init__(self, blocks: Blocks, outputs: int, own: int) -> None:
        self.shared = np.zeros((blocks.columns, blocks.columns))
        """J' J; only its upper half."""
        self.mixed = np.zeros((own, outputs, blocks.columns))
        """Q' J of each output."""
        self.own = np.zeros((1, own, own))
        """Q' Q, of each output where they differ."""
        self.after = blocks.s
        """Sensitivities of the state after the piece."""

    def add(self, blocks: Blocks) -> bool:
        """Add all samples; return False if the run diverges."""
        (own, outputs, columns), n = self.mixed.shape, len(self.after)
        linear = blocks.linear if outputs > 1 else 0
        wide = linear // n
        before, back = np.zeros((_WAITING * n, linear)), np.zeros((_WAITING * n, columns))
        mixed, product = self.mixed.reshape(own, -1), np.zeros((even(own), self.mixed[0].size))
        for index, bounded in enumerate(blocks):
            if not bounded:
                return False
            flat = blocks.rows.reshape(len(blocks.rows), -1)
            if linear:
                waiting = slice(index % _WAITING * n, (index % _WAITING + 1) * n)
                before[waiting] = blocks.before[:, :linear]
                adjoint(blocks.effective, blocks.rows, back[waiting])
                for i in range(n):
                    right = flat[:, i * (columns + wide) : (i + 1) * columns]
                    self.shared[i * wide : (i + 1) * wide, i * wide :] += (blocks.z.T @ right)[:wide]
                if waiting.stop == len(before):
                    self._add_begins(before, back)
            mixed += np.matmul(blocks.q.T, flat[:, n * columns :], out=product)[:own]
            self.own += (blocks.q.T @ blocks.q)[:own, :own]
            rest = blocks.rows[:, n:, linear:].reshape(-1, columns - linear)
            self.shared[linear:, linear:] += rest.T @ rest
        self._add_begins(before, back)
        return True

    def _add_begins(self, before: Float, back: Float) -> None:
        self.shared[: before.shape[1]] += before.T @ back
        before[:] = 0.0

    def add_lines(self, blocks: Blocks, record: Record, lines: Float) -> bool:
        """Add all frequency lines; return False if the run diverges."""
        found = transformed(record, lines, blocks)
        if found is None:
            return False
        self.own = np.repeat(self.own, len(lines), axis=0)
        for output, (jacobian, rows) in enumerate(found):
            self.shared += jacobian.T @ jacobian
            self.mixed[:, output] = rows.T @ jacobian
            self.own[output] = rows.T @ rows
        return True


def summed(system: System, record: Record, x: Float, weights: Float, span: tuple[int, int]) -> Sums | None:
    """Sum over the samples ``span`` of a record that begins with state ``x``; None if the run diverges."""
    with np.errstate(all="ignore"):
        of: Derivatives = "all" if span[0] or record.place is not None else "parameters"
        blocks = Blocks(system, record, weights, state_after(system, record.u[: span[0]], x), span, of)
        sums = Sums(blocks, *system.output.shape)
        bounded = sums.add(blocks) if record.lines is None else sums.add_lines(blocks, record, record.lines)
        return sums if bounded else None


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
