"""Compiled features of a nonlinear state-space model, their derivatives, and the simulation of the model."""

from typing import NamedTuple

import numpy as np

from vibrolock.by_address import call_at
from vibrolock.compiled import inner_kernel, kernel

TANH, SQUARE, CUBE = 0, 1, 2
"""Codes of the function g in features ``g(w . v + b) - g(b)``; they are listed in `features.FUNCTIONS`."""
_ADDRESSES = 4096
"""From here on a code is the address of a function of the user (`identification.models.pnlss.user_functions`)."""
_STEP = 6e-6
"""Relative step of the derivatives of such functions: the cube root of the rounding error."""


class Table(NamedTuple):
    """Features ``phi(v)`` of ``v = (x, u)`` as arrays; see `identification.models.pnlss.features.Features`."""

    factors: np.ndarray
    """int[n_monomials, degree], indices of the variables that are multiplied, followed by -1 for unused places."""
    limits: np.ndarray
    """float[n_variables], magnitude at which monomials clip a variable; inf for none."""
    weights: np.ndarray
    """float[n_functions, n_variables + 1], weights w of ``g(w . v + b) - g(b)``, with b in the last column."""
    at_rest: np.ndarray
    """float[n_functions], values ``g(b)`` at rest."""
    codes: np.ndarray
    """int[n_functions], code of the function g of each row."""
    slopes: np.ndarray
    """int[n_functions], address of the derivative of a user's function; 0 for finite differences and for functions of ours."""


class Matrices(NamedTuple):
    """Matrices of ``x(k+1) = A x + B u + E phi(x, u)``, ``y = C x + D u + F chi(x, u)``."""

    a: np.ndarray
    b: np.ndarray
    e: np.ndarray
    c: np.ndarray
    d: np.ndarray
    f: np.ndarray


class Workspace(NamedTuple):
    """Work arrays of a simulation."""

    v: np.ndarray
    """float[n_variables], states and inputs."""
    x: np.ndarray
    """float[n_states], the next states."""
    phi: np.ndarray
    """float[n_state_features], features of the states."""
    chi: np.ndarray
    """float[n_output_features], features of the outputs."""


def workspace(m: Matrices) -> Workspace:
    """Return the work arrays for a simulation of a model with these matrices."""
    n = m.a.shape[0]
    return Workspace(np.empty(n + m.b.shape[1]), np.empty(n), np.empty(m.e.shape[1]), np.empty(m.f.shape[1]))


@inner_kernel
def within_limits(table: Table, v: np.ndarray) -> bool:
    """Return whether no variable exceeds its limit, the usual case, in which none has to be clipped."""
    for j in range(v.size):  # noqa: SIM110 (numba compiles no generators)
        if abs(v[j]) > table.limits[j]:
            return False
    return True


@inner_kernel
def function_value(code: int, s: float) -> float:
    """Return ``g(s)`` for the function g with this code. To add a function, add a branch ``if code == ...`` ahead of tanh."""
    if code == SQUARE:
        return float(s * s)
    if code == CUBE:
        return float(s * s * s)
    if code >= _ADDRESSES:
        return float(call_at(code, s))
    return float(np.tanh(s))


@inner_kernel
def function_slope(code: int, slope: int, s: float, value: float) -> float:
    """Return ``g'(s)``, given ``value = g(s)`` and the address of a user's derivative; branches as in `function_value`."""
    if code == SQUARE:
        return float(2.0 * s)
    if code == CUBE:
        return float(3.0 * s * s)
    if code >= _ADDRESSES:
        if slope != 0:
            return float(call_at(slope, s))
        step = _STEP * max(abs(s), 1.0)
        return float((call_at(code, s + step) - call_at(code, s - step)) / (2.0 * step))
    return 1.0 - value**2


@inner_kernel
def weighted_sum(table: Table, i: int, v: np.ndarray) -> float:
    """Return ``w . v + b`` of row ``i`` of the weights."""
    total = table.weights[i, v.size]
    for j in range(v.size):
        total += table.weights[i, j] * v[j]
    return float(total)


@inner_kernel
def feature_values(table: Table, v: np.ndarray, phi: np.ndarray) -> None:
    """Write the features of ``v`` (float[n_variables]) to ``phi`` (float[n_features])."""
    count, degree = table.factors.shape
    free = within_limits(table, v)
    for i in range(count):
        product = 1.0
        for position in range(degree):
            j = table.factors[i, position]
            if j < 0:
                break
            product *= v[j] if free else min(max(v[j], -table.limits[j]), table.limits[j])
        phi[i] = product
    for i in range(table.weights.shape[0]):
        total = table.weights[i, v.size]
        for j in range(v.size):  # not `weighted_sum`: the call costs 5 % of a simulation
            total += table.weights[i, j] * v[j]
        phi[count + i] = function_value(table.codes[i], total) - table.at_rest[i]


@kernel
def feature_derivatives(table: Table, v: np.ndarray, slope: np.ndarray, steep: np.ndarray) -> None:
    """Write the derivatives of the features at ``v``.

    ``slope`` (float[n_features, n_variables]) receives the derivatives with respect to v. ``steep`` (float[n_functions, 2])
    receives ``g'`` of each weighted sum at its argument and at its bias: the derivative with respect to weight j is
    ``steep[0] v_j``, with respect to the bias ``steep[0] - steep[1]``.
    """
    count, degree = table.factors.shape
    slope[:] = 0.0
    for i in range(count):
        for position in range(degree):
            j = table.factors[i, position]
            if j < 0 or abs(v[j]) > table.limits[j]:
                continue
            product = 1.0
            for other in range(degree):
                k = table.factors[i, other]
                if other != position and k >= 0:
                    product *= min(max(v[k], -table.limits[k]), table.limits[k])
            slope[i, j] += product
    for i in range(table.weights.shape[0]):
        s, code, at = weighted_sum(table, i, v), table.codes[i], table.slopes[i]
        steep[i, 0] = function_slope(code, at, s, function_value(code, s))
        steep[i, 1] = function_slope(code, at, table.weights[i, v.size], table.at_rest[i])
        for j in range(v.size):
            slope[count + i, j] = steep[i, 0] * table.weights[i, j]


@inner_kernel
def linear_sum(a: np.ndarray, b: np.ndarray, e: np.ndarray, phi: np.ndarray, v: np.ndarray, out: np.ndarray) -> None:
    """Write ``A x + B u + E phi`` of ``v = (x, u)`` to ``out``, which must not be part of ``v``."""
    n = a.shape[1]
    for i in range(a.shape[0]):
        total = 0.0
        for j in range(n):
            total += a[i, j] * v[j]
        for j in range(b.shape[1]):
            total += b[i, j] * v[n + j]
        for j in range(phi.size):
            total += e[i, j] * phi[j]
        out[i] = total


@kernel
def simulate(
    m: Matrices,
    state_table: Table,
    output_table: Table,
    u: np.ndarray,
    x0: np.ndarray,
    bound: np.ndarray,
    work: Workspace,
    x: np.ndarray,
    y: np.ndarray,
) -> int:
    """Simulate from ``x0`` under ``u`` (float[n, n_inputs]); write ``x`` (float[n, n_states]) and ``y`` (float[n, n_outputs]).

    Returns n, or the first sample at which a state is beyond its ``bound`` (float[n_states]) or not a number, or an output is
    not finite; the values written from there on are invalid. The state after the last sample is in ``work.x``.
    """
    n, count = m.a.shape[0], u.shape[0]
    for i in range(n):
        work.x[i] = x0[i]
    for k in range(count):
        for i in range(n):
            if not abs(work.x[i]) <= bound[i]:
                return int(k)
            work.v[i] = work.x[i]
            x[k, i] = work.x[i]
        for j in range(u.shape[1]):
            work.v[n + j] = u[k, j]
        feature_values(output_table, work.v, work.chi)
        linear_sum(m.c, m.d, m.f, work.chi, work.v, y[k])
        for i in range(m.c.shape[0]):
            if not np.isfinite(y[k, i]):
                return int(k)
        feature_values(state_table, work.v, work.phi)
        linear_sum(m.a, m.b, m.e, work.phi, work.v, work.x)
    return int(count)
