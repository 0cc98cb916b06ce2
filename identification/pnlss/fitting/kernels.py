"""Compiled sensitivities of a nonlinear state-space model: blocks of its Jacobian by recursion over time."""

from typing import NamedTuple

import numpy as np

from identification.pnlss.kernels import Table, add_derivatives, feature_values
from vibrolock.compiled import kernel

__all__ = ["Room", "System", "combine_rows", "room", "sensitivities"]


class System(NamedTuple):
    """A model as its parameters stand: ``x(k+1) = [A B E] z``, ``y = [C D F] q``, ``z = (x, u, phi)``, ``q = (x, u, chi)``."""

    state: np.ndarray
    """float[n_states, n_variables + n_state_features], [A B E]."""
    output: np.ndarray
    """float[n_outputs, n_variables + n_output_features], [C D F]."""
    state_table: Table
    output_table: Table


class Room(NamedTuple):
    """What the recursion carries from sample to sample, and where it works."""

    x: np.ndarray
    """float[n_states], the state before the next sample."""
    s: np.ndarray
    """float[2, n_states, n_columns], its sensitivities, first of the two between calls."""
    z: np.ndarray
    q: np.ndarray
    of_state: np.ndarray
    """float[n_states, n_states], ``A + E d phi / d x``."""
    of_output: np.ndarray
    """float[n_outputs, n_states], ``C + F d chi / d x``."""
    state_steep: np.ndarray
    output_steep: np.ndarray


def room(system: System, columns: int) -> Room:
    """Room for a recursion with so many columns of sensitivities."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    return Room(
        np.zeros(n),
        np.zeros((2, n, columns)),
        np.zeros(system.state.shape[1]),
        np.zeros(system.output.shape[1]),
        np.zeros((n, n)),
        np.zeros((outputs, n)),
        np.zeros((system.state_table.weights.shape[0], 2)),
        np.zeros((system.output_table.weights.shape[0], 2)),
    )


@kernel
def combine_rows(factors: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """Write ``factors . rows`` to the first elements of ``out``, two rows at a time along contiguous columns."""
    count, width = rows.shape
    done = 1
    if count == 1:
        for c in range(width):
            out[c] = factors[0] * rows[0, c]
    else:
        for c in range(width):
            out[c] = factors[0] * rows[0, c] + factors[1] * rows[1, c]
        done = 2
    while done + 1 < count:
        for c in range(width):
            out[c] += factors[done] * rows[done, c] + factors[done + 1] * rows[done + 1, c]
        done += 2
    if done < count:
        for c in range(width):
            out[c] += factors[done] * rows[done, c]


@kernel
def sensitivities(
    system: System,
    u: np.ndarray,
    y: np.ndarray,
    bound: float,
    weight: np.ndarray,
    linear: int,
    counted: bool,
    r: Room,
    jacobian: np.ndarray,
    rows: np.ndarray,
) -> int:
    """Go through a block of inputs and measured outputs (float[n, n_inputs], float[n, n_outputs]), carrying ``r``.

    The columns of sensitivities are ``linear`` ones of [A B E] (row by row; 0 for none), then the weights of the saturating
    state features (row by row), if linear is not 0, then whatever began as not zero: initial states. Where the block
    counts, ``jacobian`` (float[n_outputs, n, n_columns + n_output_weights]) gets the derivatives of the weighted outputs,
    those by the weights of saturating output features last, and ``rows`` (float[n, n_output_columns + n_outputs]) q and
    the weighted errors, simulated less measured: the derivative of output l by its own [C D F] is ``weight[l] q``.

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
        if counted:
            feature_values(system.output_table, v, r.q[variables:])
            for o in range(outputs):
                total = 0.0
                for j in range(own):
                    total += system.output[o, j] * r.q[j]
                rows[k, own + o] = weight[o] * (total - y[k, o])
                for i in range(n):
                    r.of_output[o, i] = system.output[o, i]
            for j in range(own):
                rows[k, j] = r.q[j]
            add_derivatives(system.output_table, v, system.output, variables, r.output_steep, r.of_output)
            for o in range(outputs):
                for i in range(n):
                    r.of_output[o, i] *= weight[o]
            for o in range(outputs):
                combine_rows(r.of_output[o], r.s[here], jacobian[o, k])
                _output_weights(system, o, v, weight[o], r.output_steep, columns, jacobian[o, k])
        feature_values(system.state_table, v, r.z[variables:])
        for i in range(n):
            for j in range(n):
                r.of_state[i, j] = system.state[i, j]
        add_derivatives(system.state_table, v, system.state, variables, r.state_steep, r.of_state)
        after = r.s[1 - here]
        for i in range(n):
            combine_rows(r.of_state[i], r.s[here], after[i])
        for i in range(n):
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
def _output_weights(
    system: System, o: int, v: np.ndarray, weight: float, steep: np.ndarray, begin: int, row: np.ndarray
) -> None:
    monomials = system.output_table.factors.shape[0]
    for f in range(system.output_table.weights.shape[0]):
        factor = weight * system.output[o, v.size + monomials + f]
        for j in range(v.size):
            row[begin + j] = factor * steep[f, 0] * v[j]
        row[begin + v.size] = factor * (steep[f, 0] - steep[f, 1])
        begin += v.size + 1
