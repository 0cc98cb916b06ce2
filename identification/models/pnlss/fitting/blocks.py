"""Blocks of samples of a run with the derivatives of its outputs, so that memory does not grow with the number of samples."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from identification.models.pnlss.fitting.kernels import System, linearise, run, sensitivities, slopes_of
from identification.models.pnlss.fitting.records import BOUND, Record, simulated
from vibrolock.arrays import Float

Derivatives = Literal["parameters", "state", "all"]

_BYTES = 2_000_000
"""Size of the derivatives of a block: few enough to stay in the cache between the recursions and the products."""
_FEWEST, _MOST = 16, 1024  # limits of a block, samples; chosen
_EVEN = 4
"""Widths of factors of products are multiples of this: linear algebra loses a quarter of its speed on odd ones."""


def block_samples(states: int, outputs: int, columns: int) -> int:
    """Return the number of samples per block."""
    return min(max(_BYTES // (8 * (states + outputs) * columns), _FEWEST), _MOST)


class Blocks:
    """Iterator over the blocks of the samples ``begin`` to ``end`` of a record, of which only counted ones are yielded.

    The run begins at ``begin`` with the state ``x``. Derivatives are those with respect to the ``parameters``, this ``state``,
    or ``all``. After each step, the attributes describe one block of n samples; arrays are reused.

    Attributes
    ----------
    z, q
        float[n, n_wide], float[n, n_own]: (x, u, phi) and (x, u, chi), with zeros beyond.
    effective
        float[n, n_states + n_outputs, n_states], the linearised model, outputs weighted.
    rows
        float[n, n_states + n_outputs, n_columns]: room for the adjoint above the derivatives of the weighted outputs. Columns
        are [A B E], the weights in the state features, the state at ``begin``, the weights in the output features, and last
        the weighted errors.
    before, s
        float[n_states, n_sensitivities]: sensitivities of the state before the block, and after it.
    """

    def __init__(
        self,
        system: System,
        record: Record,
        weights: Float,
        x: Float,
        span: tuple[int, int],
        of: Derivatives = "all",
    ) -> None:
        n, outputs = len(system.state), len(system.output)
        self._system, self._record, self._weights, self._span = system, record, weights, span
        self._slopes, self._alike, self._x = slopes_of(system, weights), system.alike, x.copy()
        own = system.output_table.weights
        self.linear = 0 if of == "state" else system.state.size
        self._inner = 0 if of == "state" else system.state_table.weights.size
        begin = self.linear + self._inner
        columns = begin + (0 if of == "parameters" else n)
        self.columns, self.own = columns + own.size + 1, system.output.shape[1]
        self._s = np.zeros((2, n, columns))
        self._s[0, :, begin:] = np.eye(n, columns - begin)
        self._state_factors, self._output_factors = (
            np.repeat(matrix[:, matrix.shape[1] - len(table.weights) :], table.limits.size + 1, axis=1)
            for matrix, table in (
                (system.state, system.state_table),
                (weights[:, None] * system.output, system.output_table),
            )
        )
        self._most = block_samples(n, outputs, self.columns)
        self.rows = np.zeros((0, n + outputs, self.columns))
        self.before = np.zeros((n, columns))

    @property
    def s(self) -> Float:
        """float[n_states, n_sensitivities] after the last block."""
        return np.asarray(self._s[0])

    def __iter__(self) -> Iterator[bool]:
        """Yield True for each block; False at the end of a run that diverges. Possible only once."""
        for begin, end in pairwise(self._edges()):
            self._resize(end - begin)
            u, y = self._record.u[begin:end], self._record.y[begin:end]
            if run(self._system, u, BOUND, self._x, self._alike, self.z, self.q) < end - begin:
                yield False
                return
            self._linearise(y)
            self.before[:] = self.s
            into = (self._inner_rows, self._state_factors, self._s, self.rows)
            sensitivities(self.effective, self.linear, self.z, *into)
            if begin >= self._record.counted_from:
                yield True

    def _edges(self) -> list[int]:
        """First sample of each block, and the end. No block extends from what does not count, or into the next period."""
        record, (begin, end) = self._record, self._span
        period = record.period if record.lines is not None else 0
        parts = [begin, *range(max(begin, record.counted_from), end, period or end), end]
        return [edge for first, last in pairwise(parts) for edge in range(first, last, self._most)] + [end]

    def _resize(self, count: int) -> None:
        if len(self.rows) == count:
            return
        system, (_, height, columns) = self._system, self.rows.shape
        n, functions = len(system.state), len(self._slopes.by_function)
        self.z = np.zeros((count, even(system.state.shape[1])))
        self.q = self.z if self._alike else np.zeros((count, even(system.output.shape[1])))
        self.effective = np.zeros((count, height, n))
        self.rows = np.zeros((count, height, columns))
        self._inner_rows = np.zeros((count, self._inner))
        self._products = np.zeros(len(self._slopes.by_product))
        self._steep = np.zeros((count, functions, 2))

    def _linearise(self, y: Float) -> None:
        """Fill ``effective`` and those columns of ``rows`` that need no sensitivities of the state."""
        system, steep = self._system, self._steep
        into = (self._products, steep, self.effective, self.rows)
        linearise(system, self._slopes, self._weights, y, self.z, self.q, *into)
        if steep.size:
            functions, v = len(system.state_table.weights), self.z[:, : system.state_table.limits.size]
            if self._inner:
                self._inner_rows[:] = _by_weights(v, steep[:, :functions])
            by_output, end = _by_weights(v, steep[:, functions:]), self.columns - 1
            self.rows[:, len(system.state) :, end - by_output.shape[1] : end] = (
                self._output_factors * by_output[:, None]
            )


def even(width: int) -> int:
    """Return the width of a factor of products."""
    return width + -width % _EVEN


def _by_weights(v: Float, steep: Float) -> Float:
    """float[n, n_weights]: derivatives of functions of weighted sums with respect to the weights."""
    found = np.concatenate([steep[:, :, :1] * v[:, None], steep[:, :, :1] - steep[:, :, 1:]], axis=2)
    return found.reshape(len(v), -1)


SAMPLES = 600
"""Number of samples from which an initial state is estimated: a few decay times of lightly damped structures at usual rates."""
PRIOR = 1e-6
"""Weight of the squared initial state (states of unit RMS) relative to the squared errors (outputs of unit RMS).

It matters only for unobservable states.
"""
_ITERATIONS = 20  # most Levenberg-Marquardt iterations for an initial state; chosen


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
