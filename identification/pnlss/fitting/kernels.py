"""Compiled sensitivities of a nonlinear state-space model: blocks of its Jacobian by recursion over time.

All functions but the recursion itself are inlined: passing tuples of arrays would cost as much as the work on them.
"""

import numpy as np

from identification.pnlss.fitting.layout import Room, Slopes, System
from identification.pnlss.kernels import Table, feature_values, function_slope, weighted_sum
from vibrolock.compiled import inner_kernel, kernel

__all__ = ["combine_rows", "effective_matrices", "sensitivities"]


@inner_kernel
def combine_rows(factors: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """Write ``factors . rows`` to the first elements of ``out``, several rows at a time along contiguous columns."""
    count, width = rows.shape
    if count >= 4:
        f, g, h, q = factors[0], factors[1], factors[2], factors[3]
        for c in range(width):
            out[c] = f * rows[0, c] + g * rows[1, c] + h * rows[2, c] + q * rows[3, c]
        done = 4
    elif count >= 2:
        f, g = factors[0], factors[1]
        for c in range(width):
            out[c] = f * rows[0, c] + g * rows[1, c]
        done = 2
    else:
        f = factors[0]
        for c in range(width):
            out[c] = f * rows[0, c]
        done = 1
    for j in range(done, count):
        f = factors[j]
        for c in range(width):
            out[c] += f * rows[j, c]


@inner_kernel
def effective_matrices(system: System, slopes: Slopes, v: np.ndarray, r: Room) -> None:
    """Linearise at ``v``, whose features are in ``r.z`` and ``r.q``."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    if r.slopes.size:
        feature_values(slopes.table, v, r.slopes)
        combine_rows(r.slopes, slopes.coefficients, r.effective)
    else:
        r.effective[:] = 0.0
    for j in range(n):
        held = abs(v[j]) > slopes.table.limits[j]
        for i in range(n + outputs):
            linear = system.state[i, j] if i < n else system.output[i - n, j]
            r.effective[i * n + j] = linear if held else r.effective[i * n + j] + linear
    _add_functions(system.state_table, system.state, v, n, r.z, r.state_steep, r.effective[: n * n])
    _add_functions(system.output_table, system.output, v, n, r.q, r.output_steep, r.effective[n * n :])


@inner_kernel
def _add_functions(
    table: Table,
    matrix: np.ndarray,
    v: np.ndarray,
    n: int,
    features: np.ndarray,
    steep: np.ndarray,
    effective: np.ndarray,
) -> None:
    """Add the derivatives of functions of weighted sums to ``effective``; their slopes go to ``steep``."""
    first = table.limits.size + table.factors.shape[0]
    for f in range(table.weights.shape[0]):
        code, at_rest = table.codes[f], table.at_rest[f]
        steep[f, 0] = function_slope(code, weighted_sum(table, f, v), features[first + f] + at_rest)
        steep[f, 1] = function_slope(code, table.weights[f, v.size], at_rest)
        for i in range(matrix.shape[0]):
            factor = matrix[i, first + f] * steep[f, 0]
            for j in range(n):
                effective[i * n + j] += factor * table.weights[f, j]


@inner_kernel
def _add_errors(
    system: System, v: np.ndarray, y: np.ndarray, weight: np.ndarray, columns: int, r: Room, errors: np.ndarray
) -> None:
    """Write the errors of a sample, weight the linearised outputs, and add errors times derivatives to the gradients."""
    n = system.state.shape[0]
    outputs, own = system.output.shape
    r.back[:] = 0.0
    for o in range(outputs):
        total = -y[o]
        for j in range(own):
            total += system.output[o, j] * r.q[j]
        error = weight[o] * total
        errors[o] = error
        for j in range(own):
            r.own_gradient[o, j] += weight[o] * error * r.q[j]
        _output_weights(system, o, v, weight[o], r.output_steep, r.row)
        for c in range(r.row.size):
            r.gradient[columns + c] += error * r.row[c]
        for i in range(n):
            r.effective[(n + o) * n + i] *= weight[o]
            r.back[i] += error * r.effective[(n + o) * n + i]


@inner_kernel
def _output_weights(system: System, o: int, v: np.ndarray, weight: float, steep: np.ndarray, row: np.ndarray) -> None:
    """Write the derivatives of output ``o`` with respect to the weights in its features."""
    begin = 0
    monomials = system.output_table.factors.shape[0]
    for f in range(system.output_table.weights.shape[0]):
        factor = weight * system.output[o, v.size + monomials + f]
        for j in range(v.size):
            row[begin + j] = factor * steep[f, 0] * v[j]
        row[begin + v.size] = factor * (steep[f, 0] - steep[f, 1])
        begin += v.size + 1


@inner_kernel
def _keep(
    system: System, v: np.ndarray, s: np.ndarray, weight: np.ndarray, r: Room, jacobian: np.ndarray, row: np.ndarray
) -> None:
    """Write the derivatives of the weighted outputs to ``jacobian`` (float[n_outputs, ...]), q to ``row``."""
    n, columns = s.shape
    for o in range(system.output.shape[0]):
        combine_rows(r.effective[(n + o) * n : (n + o + 1) * n], s, jacobian[o])
        _output_weights(system, o, v, weight[o], r.output_steep, jacobian[o, columns:])
    for j in range(row.size):
        row[j] = r.q[j]


@inner_kernel
def _advance(system: System, v: np.ndarray, linear: int, s: np.ndarray, r: Room, after: np.ndarray) -> None:
    """Step the state, and its sensitivities from ``s`` to ``after``."""
    n, wide = system.state.shape
    monomials = system.state_table.factors.shape[0]
    for i in range(n):
        combine_rows(r.effective[i * n : (i + 1) * n], s, after[i])
        total = 0.0
        for j in range(wide):
            total += system.state[i, j] * r.z[j]
        r.x[i] = total
        if linear == 0:
            continue
        for j in range(wide):
            after[i, i * wide + j] += r.z[j]
        for f in range(system.state_table.weights.shape[0]):
            begin = linear + f * (v.size + 1)
            factor = system.state[i, v.size + monomials + f]
            for j in range(v.size):
                after[i, begin + j] += factor * r.state_steep[f, 0] * v[j]
            after[i, begin + v.size] += factor * (r.state_steep[f, 0] - r.state_steep[f, 1])


@kernel
def sensitivities(
    system: System,
    slopes: Slopes,
    u: np.ndarray,
    y: np.ndarray,
    bound: float,
    weight: np.ndarray,
    linear: int,
    counted: bool,
    kept: np.ndarray,
    r: Room,
    jacobian: np.ndarray,
    rows: np.ndarray,
    errors: np.ndarray,
) -> int:
    """Process a block of inputs and measured outputs (float[n, n_inputs], float[n, n_outputs]), with the state in ``r``.

    The columns of the sensitivities are first the ``linear`` entries of [A B E] (row by row; 0 for none), then, unless linear
    is 0, the weights in the state features (row by row), then the initial states. If the block is ``counted``, these arrays
    are written:

    - ``errors`` (float[n, n_outputs]): the weighted errors, simulated minus measured.
    - ``r``: the sums of the products of errors and derivatives.
    - ``jacobian`` (float[n_outputs, n_kept, n_columns + n_output_weights]): the derivatives of the weighted outputs at the
      samples ``kept`` (int[n_kept], rising), with the weights in the output features last.
    - ``rows`` (float[n_kept, n_output_columns]): q at the same samples. The derivative of output l with respect to its row of
      [C D F] is ``weight[l] q``.

    Returns n, or the sample at which a state is beyond ``bound`` or not a number.
    """
    n, columns = system.state.shape[0], r.s.shape[2]
    variables = system.state_table.limits.size
    here, at = 0, 0
    for k in range(u.shape[0]):
        for i in range(n):
            if not abs(r.x[i]) <= bound:
                return int(k)
        for j in range(variables):
            r.z[j] = r.x[j] if j < n else u[k, j - n]
            r.q[j] = r.z[j]
        v, s = r.z[:variables], r.s[here]
        feature_values(system.state_table, v, r.z[variables:])
        feature_values(system.output_table, v, r.q[variables:])
        effective_matrices(system, slopes, v, r)
        if counted:
            _add_errors(system, v, y[k], weight, columns, r, errors[k])
            for i in range(n):
                for c in range(columns):
                    r.gradient[c] += r.back[i] * s[i, c]
            if at < kept.size and kept[at] == k:
                _keep(system, v, s, weight, r, jacobian[:, at], rows[at])
                at += 1
        _advance(system, v, linear, s, r, r.s[1 - here])
        here = 1 - here
    if here == 1:
        for i in range(n):
            for c in range(columns):
                r.s[0, i, c] = r.s[1, i, c]
    return int(u.shape[0])
