"""Compiled simulation of a model whose input force depends on its own output."""

import numpy as np

from identification.exciter_coupling.kernels import (
    EXACT,
    ITERATIONS,
    advance_filter,
    free_force,
    largest_of,
    secant_step,
)
from identification.exciter_coupling.loop import Loop
from identification.models.pnlss.kernels import Matrices, Table, Workspace, feature_values, outputs_at, state_after
from vibrolock.compiled import kernel


@kernel
def simulate_coupled(
    m: Matrices,
    state_table: Table,
    output_table: Table,
    loop: Loop,
    row: int,
    output: int,
    given: np.ndarray,
    bound: np.ndarray,
    work: Workspace,
    xi: np.ndarray,
    after: np.ndarray,
    force: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
) -> int:
    """Simulate from rest. Input ``row`` is ``given`` (float[n]) plus the reaction to ``output``; other inputs are zero.

    Writes ``force`` (float[n]), ``x`` (float[n, n_states]) and ``y`` (float[n, n_outputs]); ``xi`` and ``after``
    (float[n_xi]) are work arrays. The output responds to the force without delay, so that the force of each sample is the
    solution of a scalar equation. It is found by the secant method, whose first step is exact if the features do not depend
    on the force. Returns n, or the first sample at which a state exceeds its ``bound``, an output is not finite or no force
    is found; values from that sample on are not valid.
    """
    n, count = m.a.shape[0], given.size
    largest = largest_of(given)
    for i in range(n):
        work.x[i] = 0.0
    for i in range(xi.size):
        xi[i] = 0.0
    for i in range(work.v.size):
        work.v[i] = 0.0
    linear = 1.0 - loop.d * m.d[output, row]
    new = 0.0
    for k in range(count):
        for i in range(n):
            if not abs(work.x[i]) <= bound[i]:
                return int(k)
            work.v[i] = work.x[i]
        free = free_force(loop, xi, given[k])
        at, short, slope, found = 0.0, 0.0, linear, False
        for trial in range(ITERATIONS):
            work.v[n + row] = new
            feature_values(output_table, work.v, work.chi)
            outputs_at(m, work.chi, work.v, y[k])
            left = new - free - loop.d * y[k, output]
            if abs(left) <= EXACT * (abs(new) + largest):
                found = True
                break
            following, slope = secant_step(trial, new, left, at, short, slope)
            if slope == 0.0:
                break
            at, short, new = new, left, following
        for i in range(y.shape[1]):
            found = found and bool(np.isfinite(y[k, i]))
        if not found:
            return int(k)
        force[k] = new
        for i in range(n):
            x[k, i] = work.x[i]
        feature_values(state_table, work.v, work.phi)
        state_after(m, work.phi, work.v, work.x)
        advance_filter(loop, xi, after, y[k, output])
    return int(count)
