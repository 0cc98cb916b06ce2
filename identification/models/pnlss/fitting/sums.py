"""Products of the Jacobian of a piece of a record, summed block by block.

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

import numpy as np

from identification.models.pnlss.fitting.blocks import Blocks, Derivatives, even
from identification.models.pnlss.fitting.frequency_lines import transformed
from identification.models.pnlss.fitting.kernels import adjoint
from identification.models.pnlss.fitting.layout import System
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
        """Add all samples; return False if the run leaves all bounds."""
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
        """Add all frequency lines; return False if the run leaves all bounds."""
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
    """Sum over the samples ``span`` of a record that begins with state ``x``; None if the run leaves all bounds."""
    with np.errstate(all="ignore"):
        of: Derivatives = "all" if span[0] or record.place is not None else "parameters"
        blocks = Blocks(system, record, weights, state_after(system, record.u[: span[0]], x), span, of)
        sums = Sums(blocks, *system.output.shape)
        bounded = sums.add(blocks) if record.lines is None else sums.add_lines(blocks, record, record.lines)
        return sums if bounded else None
