"""Compiled sensitivities of a nonlinear state-space model: blocks of its Jacobian by recursion over time."""

from typing import NamedTuple

import numpy as np

from identification.pnlss.kernels import Table, feature_values
from vibrolock.compiled import kernel

__all__ = ["Room", "Slopes", "System", "combine_rows", "effective_matrices", "room", "sensitivities"]


class System(NamedTuple):
    """A model as its parameters stand: ``x(k+1) = [A B E] z``, ``y = [C D F] q``, ``z = (x, u, phi)``, ``q = (x, u, chi)``."""

    state: np.ndarray
    """float[n_states, n_variables + n_state_features], [A B E]."""
    output: np.ndarray
    """float[n_outputs, n_variables + n_output_features], [C D F]."""
    state_table: Table
    output_table: Table


class Slopes(NamedTuple):
    """Derivatives of the monomials of a system, which are a few monomials themselves."""

    table: Table
    """Monomials that occur in derivatives, of degree one and above."""
    coefficients: np.ndarray
    """float[n_monomials, (n_states + n_outputs) * n_states]: their shares in ``E d phi / d x`` and ``F d chi / d x``."""


class Room(NamedTuple):
    """What the recursion carries from sample to sample, and where it works."""

    x: np.ndarray
    """float[n_states], the state before the next sample."""
    s: np.ndarray
    """float[2, n_states, n_columns], its sensitivities, first of the two between calls."""
    z: np.ndarray
    q: np.ndarray
    slopes: np.ndarray
    """float[n_slopes], the monomials in derivatives."""
    effective: np.ndarray
    """float[(n_states + n_outputs) * n_states], ``A + E d phi / d x`` above ``C + F d chi / d x``."""
    back: np.ndarray
    """float[n_states], errors through the outputs."""
    gradient: np.ndarray
    """float[n_columns + n_output_weights], derivatives times errors, summed."""
    own_gradient: np.ndarray
    """float[n_outputs, n_output_columns], the same of [C D F]."""
    row: np.ndarray
    """float[n_output_weights], derivatives of an output by the weights in its features."""
    state_steep: np.ndarray
    output_steep: np.ndarray


def room(system: System, slopes: Slopes, columns: int) -> Room:
    """Room for a recursion with so many columns of sensitivities."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    return Room(
        np.zeros(n),
        np.zeros((2, n, columns)),
        np.zeros(system.state.shape[1]),
        np.zeros(system.output.shape[1]),
        np.zeros(len(slopes.coefficients)),
        np.zeros((n + outputs) * n),
        np.zeros(n),
        np.zeros(columns + system.output_table.weights.size),
        np.zeros((outputs, system.output.shape[1])),
        np.zeros(system.output_table.weights.size),
        np.zeros((system.state_table.weights.shape[0], 2)),
        np.zeros((system.output_table.weights.shape[0], 2)),
    )


@kernel
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


@kernel
def effective_matrices(system: System, slopes: Slopes, v: np.ndarray, r: Room) -> None:
    """Linearise at ``v``, whose features are in ``r.z`` and ``r.q``."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    if r.slopes.size:
        feature_values(slopes.table, v, r.slopes)
        combine_rows(r.slopes, slopes.coefficients, r.effective)
    else:
        for i in range(r.effective.size):
            r.effective[i] = 0.0
    for j in range(n):
        held = abs(v[j]) > slopes.table.limits[j]
        for i in range(n + outputs):
            linear = system.state[i, j] if i < n else system.output[i - n, j]
            r.effective[i * n + j] = linear if held else r.effective[i * n + j] + linear
    _add_saturating(system.state_table, system.state, n, r.z, r.state_steep, r.effective[: n * n])
    _add_saturating(system.output_table, system.output, n, r.q, r.output_steep, r.effective[n * n :])


@kernel
def _add_saturating(
    table: Table, matrix: np.ndarray, n: int, features: np.ndarray, steep: np.ndarray, effective: np.ndarray
) -> None:
    first = table.limits.size + table.factors.shape[0]
    for f in range(table.weights.shape[0]):
        steep[f, 0] = 1.0 - (features[first + f] + table.at_rest[f]) ** 2
        steep[f, 1] = 1.0 - table.at_rest[f] ** 2
        for i in range(matrix.shape[0]):
            factor = matrix[i, first + f] * steep[f, 0]
            for j in range(n):
                effective[i * n + j] += factor * table.weights[f, j]


@kernel
def sensitivities(
    system: System,
    slopes: Slopes,
    u: np.ndarray,
    y: np.ndarray,
    bound: float,
    weight: np.ndarray,
    linear: int,
    every: int,
    r: Room,
    jacobian: np.ndarray,
    rows: np.ndarray,
    errors: np.ndarray,
) -> int:
    """Go through a block of inputs and measured outputs (float[n, n_inputs], float[n, n_outputs]), carrying ``r``.

    The columns of sensitivities are ``linear`` ones of [A B E] (row by row; 0 for none), then the weights of the saturating
    state features (row by row), if linear is not 0, then whatever began as not zero: initial states. ``every`` is 0 where
    the block does not count. Else ``errors`` (float[n, n_outputs]) gets the weighted errors, simulated less measured,
    ``r`` their products with all derivatives, and of each ``every``-th sample, the first one to begin with, ``jacobian``
    (float[n_outputs, n / every, n_columns + n_output_weights]) gets the derivatives of the weighted outputs, those by the
    weights of saturating output features last, and ``rows`` (float[n / every, n_output_columns]) q: the derivative of
    output l by its own [C D F] is ``weight[l] q``.

    Returns n, or the sample at which a state is beyond ``bound`` or not a number.
    """
    n, columns = system.state.shape[0], r.s.shape[2]
    variables, wide = system.state_table.limits.size, system.state.shape[1]
    outputs, own = system.output.shape
    monomials = system.state_table.factors.shape[0]
    here = 0
    for k in range(u.shape[0]):
        for i in range(n):
            if not abs(r.x[i]) <= bound:
                return int(k)
            r.z[i] = r.x[i]
            r.q[i] = r.x[i]
        for j in range(n, variables):
            r.z[j] = u[k, j - n]
            r.q[j] = u[k, j - n]
        v = r.z[:variables]
        feature_values(system.state_table, v, r.z[variables:])
        feature_values(system.output_table, v, r.q[variables:])
        effective_matrices(system, slopes, v, r)
        if every > 0:
            for i in range(n):
                r.back[i] = 0.0
            for o in range(outputs):
                total = -y[k, o]
                for j in range(own):
                    total += system.output[o, j] * r.q[j]
                error = weight[o] * total
                errors[k, o] = error
                for j in range(own):
                    r.own_gradient[o, j] += weight[o] * error * r.q[j]
                _output_weights(system, o, v, weight[o], r.output_steep, r.row)
                for c in range(r.row.size):
                    r.gradient[columns + c] += error * r.row[c]
                at = (n + o) * n
                for i in range(n):
                    r.effective[at + i] *= weight[o]
                    r.back[i] += error * r.effective[at + i]
                if k % every == 0:
                    combine_rows(r.effective[at : at + n], r.s[here], jacobian[o, k // every])
                    for c in range(r.row.size):
                        jacobian[o, k // every, columns + c] = r.row[c]
            for i in range(n):
                back = r.back[i]
                for c in range(columns):
                    r.gradient[c] += back * r.s[here, i, c]
            if k % every == 0:
                for j in range(own):
                    rows[k // every, j] = r.q[j]
        after = r.s[1 - here]
        for i in range(n):
            combine_rows(r.effective[i * n : (i + 1) * n], r.s[here], after[i])
            total = 0.0
            for j in range(wide):
                total += system.state[i, j] * r.z[j]
            r.x[i] = total
            if linear > 0:
                begin = i * wide
                for j in range(wide):
                    after[i, begin + j] += r.z[j]
                for f in range(system.state_table.weights.shape[0]):
                    begin = linear + f * (variables + 1)
                    factor = system.state[i, variables + monomials + f]
                    for j in range(variables):
                        after[i, begin + j] += factor * r.state_steep[f, 0] * v[j]
                    after[i, begin + variables] += factor * (r.state_steep[f, 0] - r.state_steep[f, 1])
        here = 1 - here
    if here == 1:
        for i in range(n):
            for c in range(columns):
                r.s[0, i, c] = r.s[1, i, c]
    return int(u.shape[0])


@kernel
def _output_weights(system: System, o: int, v: np.ndarray, weight: float, steep: np.ndarray, row: np.ndarray) -> None:
    begin = 0
    monomials = system.output_table.factors.shape[0]
    for f in range(system.output_table.weights.shape[0]):
        factor = weight * system.output[o, v.size + monomials + f]
        for j in range(v.size):
            row[begin + j] = factor * steep[f, 0] * v[j]
        row[begin + v.size] = factor * (steep[f, 0] - steep[f, 1])
        begin += v.size + 1
