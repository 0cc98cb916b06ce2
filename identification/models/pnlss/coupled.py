"""Simulate a force-driven PNLSS model together with an identified exciter, from the recorded voltage (`Passes`)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from identification.exciter_coupling.exciter import Exciter
from identification.exciter_coupling.kernels import (
    EXACT,
    ITERATIONS,
    Loop,
    advance_filter,
    free_force,
    largest_of,
    secant_step,
)
from identification.exciter_coupling.passes import Passes, drive_point
from identification.experiments.simulation import Simulation, use_of
from identification.models.pnlss.kernels import Matrices, Table, Workspace, feature_values, linear_sum, workspace
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float
from vibrolock.compiled import kernel


class CoupledRun(Simulation):
    """A simulated run of a model with its exciter: the fields of `Simulation`."""


def coupled_run(
    model: PnlssModel,
    exciter: Exciter,
    voltage_v: ArrayLike,
    lowest_hz: float | None,
    default_hz: Callable[[], float],
) -> CoupledRun:
    """Simulate both from rest, as `identification.coupled_run` describes; ``default_hz`` gives ``lowest_hz`` if it is None."""
    at = drive_point(model, model.sample_rate_hz, lowest_hz, default_hz)
    passes = Passes(exciter, at, model.linear_part, model.sample_rate_hz, voltage_v)
    m, loop, n = model.matrices, passes.loop, passes.n
    tables = (model.state_features.table, model.output_features.table)
    x, y = np.empty((passes.count, model.states)), np.empty((passes.count, len(model.outputs)))
    force, xi, after, work = np.empty(passes.count), np.empty(loop.b.size), np.empty(loop.b.size), workspace(m)

    def simulate(given: Float) -> int:
        return int(
            simulate_coupled(m, *tables, loop, at.row, at.output, given, model.bound, work, xi, after, force, x, y)
        )

    reached, count, change = passes.run(simulate, force, y[:, at.output])
    x, y, force = x[:n], y[:n], force[:n]
    x[reached:], y[reached:], force[reached:] = np.nan, np.nan, np.nan
    inputs = np.zeros(len(model.inputs))
    inputs[at.row] = np.max(np.abs(force[:reached]), initial=0.0)
    notes = passes.notes(reached, count, change)
    if np.max(np.abs(np.linalg.eigvals(model.a))) > 1.0:
        notes.append("the model's linear part is unstable")
    return CoupledRun(
        outputs=y.T,
        states=x.T,
        state_use=use_of(np.max(np.abs(x[:reached]), axis=0, initial=0.0), model.state_range),
        input_use=use_of(inputs, model.input_range),
        unbounded_at=None if reached == n else reached,
        force_n=force,
        passes=count,
        change=change,
        notes=tuple(notes),
    )


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
    work.x[:], xi[:], work.v[:] = 0.0, 0.0, 0.0
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
            linear_sum(m.c, m.d, m.f, work.chi, work.v, y[k])
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
        linear_sum(m.a, m.b, m.e, work.phi, work.v, work.x)
        advance_filter(loop, xi, after, y[k, output])
    return int(count)
