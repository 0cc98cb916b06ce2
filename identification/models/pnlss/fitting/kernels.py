"""Compiled passes over a block of samples: the states, their sensitivities forward, and the adjoint of these back.

Inner kernels are inlined: passing tuples of arrays would cost as much as the work on them.
"""

from typing import NamedTuple

import numpy as np

from identification.models.pnlss.kernels import Table, feature_values, function_slope, weighted_sum
from vibrolock.arrays import Float
from vibrolock.compiled import inner_kernel, unlocked_kernel


class System(NamedTuple):
    """A model with its parameters: ``x(k+1) = [A B E] z``, ``y = [C D F] q`` with ``z = (x, u, phi)``, ``q = (x, u, chi)``."""

    state: np.ndarray
    """float[n_states, n_variables + n_state_features], [A B E]."""
    output: np.ndarray
    """float[n_outputs, n_variables + n_output_features], [C D F]."""
    state_table: Table
    output_table: Table

    @property
    def alike(self) -> bool:
        """Whether states and outputs have the same features."""
        return all(map(np.array_equal, self.state_table, self.output_table))


class Slopes(NamedTuple):
    """``A + E d phi / d x`` above ``C + F d chi / d x`` as a combination of few values; of n_effective elements."""

    linear: np.ndarray
    """float[n_effective], A above C, row by row."""
    products: Table
    """Monomials that occur in derivatives, of degree one and above."""
    by_product: np.ndarray
    """float[n_monomials, n_effective]."""
    by_function: np.ndarray
    """float[n_functions, n_effective], coefficients of the slopes of functions, of states first."""


def slopes_of(system: System, weights: Float) -> Slopes:
    """Return the linearisation of a system whose outputs are multiplied by ``weights``, with as few monomials as possible.

    The derivatives of a cubic model need few products, however many monomials it has.
    """
    n, variables = system.state.shape[0], system.state_table.limits.size
    whole = np.concatenate([system.state[:, :n], weights[:, None] * system.output[:, :n]])
    products: dict[tuple[int, ...], Float] = {}
    functions: list[Float] = []
    for first, matrix, table in (
        (0, system.state, system.state_table),
        (n, weights[:, None] * system.output, system.output_table),
    ):
        here = slice(first, first + len(matrix))
        for index, row in enumerate(table.factors):
            factors = [int(j) for j in row if j >= 0]
            for position, j in enumerate(factors):
                if j >= n:
                    continue
                rest = tuple(factors[:position] + factors[position + 1 :])
                products.setdefault(rest, np.zeros(whole.shape))[here, j] += matrix[:, variables + index]
        for index, row in enumerate(table.weights):
            functions.append(np.zeros(whole.shape))
            functions[-1][here] = np.outer(matrix[:, variables + len(table.factors) + index], row[:n])
    degree = max((len(rest) for rest in products), default=0)
    padded = [(*rest, *[-1] * (degree - len(rest))) for rest in products]
    table = Table(
        np.array(padded, dtype=np.int64).reshape(len(products), degree),
        np.minimum(system.state_table.limits, system.output_table.limits),
        np.zeros((0, variables + 1)),
        np.zeros(0),
        np.zeros(0, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
    )
    return Slopes(
        whole.ravel(),
        table,
        np.array(list(products.values())).reshape(-1, whole.size),
        np.array(functions).reshape(-1, whole.size),
    )


@inner_kernel
def _combine(factors: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """Write ``factors . rows`` to the first columns of ``out``: blocks of two by four, along contiguous columns."""
    height, count, width = factors.shape[0], rows.shape[0], rows.shape[1]
    pairs, fours = height - height % 2, count - count % 4
    for i in range(height):
        if count < 4 or i >= pairs:
            for c in range(width):
                out[i, c] = 0.0
    for i in range(0, pairs, 2):
        for j in range(0, fours, 4):
            f0, f1, f2, f3 = factors[i, j], factors[i, j + 1], factors[i, j + 2], factors[i, j + 3]
            g0, g1, g2, g3 = factors[i + 1, j], factors[i + 1, j + 1], factors[i + 1, j + 2], factors[i + 1, j + 3]
            if j == 0:
                for c in range(width):
                    r0, r1, r2, r3 = rows[j, c], rows[j + 1, c], rows[j + 2, c], rows[j + 3, c]
                    out[i, c] = f0 * r0 + f1 * r1 + f2 * r2 + f3 * r3
                    out[i + 1, c] = g0 * r0 + g1 * r1 + g2 * r2 + g3 * r3
            else:
                for c in range(width):
                    r0, r1, r2, r3 = rows[j, c], rows[j + 1, c], rows[j + 2, c], rows[j + 3, c]
                    out[i, c] += f0 * r0 + f1 * r1 + f2 * r2 + f3 * r3
                    out[i + 1, c] += g0 * r0 + g1 * r1 + g2 * r2 + g3 * r3
    for i in range(height):
        for j in range(fours if i < pairs else 0, count):
            f = factors[i, j]
            for c in range(width):
                out[i, c] += f * rows[j, c]


@inner_kernel
def _copy(rows: np.ndarray, out: np.ndarray) -> None:
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            out[i, c] = rows[i, c]


@inner_kernel
def _product(matrix: np.ndarray, z: np.ndarray, x: np.ndarray) -> None:
    """Write ``matrix . z`` to ``x``: four rows at a time, whose sums do not wait for each other."""
    rows, width = matrix.shape
    fours = rows - rows % 4
    for i in range(0, fours, 4):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(width):
            a += matrix[i, j] * z[j]
            b += matrix[i + 1, j] * z[j]
            c += matrix[i + 2, j] * z[j]
            d += matrix[i + 3, j] * z[j]
        x[i], x[i + 1], x[i + 2], x[i + 3] = a, b, c, d
    for i in range(fours, rows):
        a = 0.0
        for j in range(width):
            a += matrix[i, j] * z[j]
        x[i] = a


@unlocked_kernel
def run(system: System, u: np.ndarray, bound: float, x: np.ndarray, alike: bool, z: np.ndarray, q: np.ndarray) -> int:
    """Simulate from ``x`` under ``u`` (float[n, n_inputs]); ``x`` becomes the state after the last sample.

    Write ``(x, u, phi)`` to ``z`` and, unless they are ``alike``, ``(x, u, chi)`` to ``q`` (float[n, ...], may be wider).
    Returns n, or the sample at which a state is beyond ``bound`` or not a number.
    """
    n, variables = system.state.shape[0], system.state_table.limits.size
    for k in range(u.shape[0]):
        for j in range(variables):
            z[k, j] = x[j] if j < n else u[k, j - n]
        for i in range(n):
            if not abs(x[i]) <= bound:
                return int(k)
        v = z[k, :variables]
        feature_values(system.state_table, v, z[k, variables:])
        _product(system.state, z[k], x)
        if not alike:
            for j in range(variables):
                q[k, j] = v[j]
            feature_values(system.output_table, v, q[k, variables:])
    return int(u.shape[0])


@unlocked_kernel
def linearise(
    system: System,
    slopes: Slopes,
    weights: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    q: np.ndarray,
    products: np.ndarray,
    steep: np.ndarray,
    effective: np.ndarray,
    rows: np.ndarray,
) -> None:
    """Linearise the model at each sample of a run, and compare its outputs with measured ones ``y`` (float[n, n_outputs]).

    Write the slopes of functions to ``steep`` (float[n, n_functions, 2]), the linearised model with weighted outputs to
    ``effective`` (float[n, n_states + n_outputs, n_states]), and the weighted errors to the last column of ``rows`` (float[n,
    n_states + n_outputs, n_columns]). ``products`` (float[n_products]) is work space.
    """
    variables, functions = system.state_table.limits.size, system.state_table.weights.shape[0]
    n = system.state.shape[0]
    for k in range(y.shape[0]):
        v, flat = z[k, :variables], effective[k].reshape(slopes.linear.size)
        feature_values(slopes.products, v, products)
        _slopes(system.state_table, v, z[k], steep[k])
        _slopes(system.output_table, v, q[k], steep[k, functions:])
        for c in range(flat.size):
            flat[c] = 0.0
        fours = products.size - products.size % 4
        for m in range(0, fours, 4):
            a, b, d, e = products[m], products[m + 1], products[m + 2], products[m + 3]
            by = slopes.by_product[m : m + 4]
            for c in range(flat.size):
                flat[c] += a * by[0, c] + b * by[1, c] + d * by[2, c] + e * by[3, c]
        for m in range(fours, products.size):
            for c in range(flat.size):
                flat[c] += products[m] * slopes.by_product[m, c]
        for j in range(n):
            if abs(v[j]) > slopes.products.limits[j]:
                effective[k, :, j] = 0.0
        for c in range(flat.size):
            flat[c] += slopes.linear[c]
        for f in range(steep.shape[1]):
            for c in range(flat.size):
                flat[c] += steep[k, f, 0] * slopes.by_function[f, c]
        errors = rows[k, n:, rows.shape[2] - 1]
        _product(system.output, q[k], errors)
        for o in range(errors.size):
            errors[o] = weights[o] * (errors[o] - y[k, o])


@inner_kernel
def _slopes(table: Table, v: np.ndarray, features: np.ndarray, steep: np.ndarray) -> None:
    """Write the slope of each function at its weighted sum, and at its bias."""
    first = v.size + table.factors.shape[0]
    for f in range(table.weights.shape[0]):
        code, at, at_rest = table.codes[f], table.slopes[f], table.at_rest[f]
        steep[f, 0] = function_slope(code, at, weighted_sum(table, f, v), features[first + f] + at_rest)
        steep[f, 1] = function_slope(code, at, table.weights[f, v.size], at_rest)


@unlocked_kernel
def sensitivities(
    effective: np.ndarray,
    linear: int,
    z: np.ndarray,
    inner: np.ndarray,
    factors: np.ndarray,
    s: np.ndarray,
    rows: np.ndarray,
) -> None:
    """Carry the sensitivities ``s`` of the state (float[2, n_states, n_columns], the first is current) over a block.

    Their first columns are the ``linear`` elements of [A B E] (row by row) and the weights in the state features; ``z`` and
    ``inner`` (float[n, ...]) are the derivatives with respect to these, the latter still to be multiplied by ``factors``
    (float[n_states, n_weights]). The derivatives of the outputs by ``effective`` (float[n, n_states + n_outputs, n_states])
    are written to ``rows`` (float[n, n_states + n_outputs, ...]).
    """
    n, here = s.shape[1], 0
    wide = linear // n
    for k in range(effective.shape[0]):
        before, after = s[here], s[1 - here]
        _combine(effective[k, n:], before, rows[k, n:])
        _combine(effective[k, :n], before, after)
        for i in range(n):
            for j in range(wide):
                after[i, i * wide + j] += z[k, j]
            for c in range(inner.shape[1]):
                after[i, linear + c] += factors[i, c] * inner[k, c]
        here = 1 - here
    if here == 1:
        _copy(s[1], s[0])


@unlocked_kernel
def adjoint(effective: np.ndarray, rows: np.ndarray, back: np.ndarray) -> None:
    """Carry the derivatives of the outputs, in ``rows`` below those of the states, back over a block.

    Row i of the states at sample k becomes the sum, over all later outputs of the block, of their derivatives times those
    with respect to state i after sample k; ``back`` (float[n_states, n_columns]) the same before the block.
    """
    n, end = back.shape[0], effective.shape[0] - 1
    rows[end, :n] = 0.0
    for k in range(end, 0, -1):
        _combine(effective[k].T, rows[k], rows[k - 1])
    _combine(effective[0].T, rows[0], back)
