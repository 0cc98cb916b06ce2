"""Compiled run of a structured model with the exact derivatives of its outputs, forward in time."""

import math
from typing import NamedTuple

import numpy as np

from identification.models.structured.elements import DerivativeTables
from identification.models.structured.hysteresis import hysteresis_by, hysteresis_step, memory_of
from identification.models.structured.kernels import damping_at, jenkins_step, mean_spring, spring_at
from identification.models.structured.steps import (
    System,
    Workspace,
    accelerate,
    dot,
    end_step,
    solve,
    take_input,
    take_step,
)
from vibrolock.compiled import inner_kernel, unlocked_kernel


class Sensitivities(NamedTuple):
    """Derivatives of a state by P parameters.

    A slider that sticks has the derivatives of its stiffness times the displacement of its element, plus a row that stays while
    it sticks. Steps therefore change the rows of sliders only where one begins to stick or to slip.
    """

    rows: np.ndarray
    """float[`System.size`, P]: derivatives of the state; of a slider that sticks, those less stiffness times displacement."""
    sums: np.ndarray
    """float[n_elements, P]: sum of the rows of the sliders of an element that stick."""
    sticks: np.ndarray
    """bool[n_sliders]."""


@inner_kernel
def add(out: np.ndarray, factor: float, row: np.ndarray) -> None:
    """Add a multiple of a row."""
    for c in range(out.size):
        out[c] += factor * row[c]


@inner_kernel
def add_linear(
    system: System,
    work: Workspace,
    speed: np.ndarray,
    place: np.ndarray,
    mean: float,
    sens: np.ndarray,
    rhs: np.ndarray,
) -> None:
    """Add the explicit derivatives of the forces on the modes at ``place`` and ``speed`` by omega, zeta, b and the support."""
    n, inputs, support = place.size, system.inputs, system.support
    last = rhs.shape[1] - 1
    steep = 0.0
    if support[2] > 0.0:
        steep = 1.0 - math.tanh(support[0] * mean / support[2]) ** 2
    for i in range(n):
        rhs[i, i] -= 2.0 * system.zeta[i] * speed[i] + 2.0 * system.omega[i] * place[i]
        rhs[i, n + i] -= 2.0 * system.omega[i] * speed[i]
        for j in range(inputs):
            rhs[i, 2 * n + i * inputs + j] += work.u[j]
        if steep != 0.0:
            add(rhs[i], -system.b[i, 0] * steep * support[0], sens[2 * n])
            rhs[i, last] -= system.b[i, 0] * steep * mean


@inner_kernel
def of_displacement(system: System, work: Workspace, e: int, place: np.ndarray, sens: np.ndarray) -> None:
    """Write the derivatives of an element's displacement by the parameters into ``work.row``."""
    n = place.size
    begin = 2 * n + n * system.inputs + e * n
    work.row[:] = 0.0
    for i in range(n):
        add(work.row, system.phi[e, i], sens[i])
        work.row[begin + i] += place[i]


@inner_kernel
def add_dforce(system: System, work: Workspace, e: int, speed: np.ndarray, rhs: np.ndarray) -> None:
    """Add the derivatives of an element's force on the modes, whose size has the derivatives ``work.dforce``."""
    n = speed.size
    begin = 2 * n + n * system.inputs + e * n
    for k in range(n):
        work.dforce[begin + k] += work.forces[e, 2] * speed[k]
        rhs[k, begin + k] -= work.forces[e, 0]
    for i in range(n):
        add(rhs[i], -system.phi[e, i], work.dforce)


@inner_kernel
def add_sliders(system: System, work: Workspace, e: int, derivatives: Sensitivities) -> None:
    """Add the derivatives of the forces of an element's sliders to ``work.dforce``; ``work.row``: of its displacement."""
    tables, stiffness = system.tables, 0.0
    for s in range(tables.first[e], tables.first[e + 1]):
        if derivatives.sticks[s]:
            stiffness += tables.sliders[s, 0]
    add(work.dforce, stiffness, work.row)
    add(work.dforce, 1.0, derivatives.sums[e])


@inner_kernel
def of_acceleration(
    system: System,
    work: Workspace,
    changes: DerivativeTables,
    state: np.ndarray,
    derivatives: Sensitivities,
    rhs: np.ndarray,
) -> None:
    """Write the derivatives of the accelerations at a sample by the parameters."""
    sens = derivatives.rows
    n, columns, tables = system.omega.size, sens.shape[1], system.tables
    q, v = state[:n], state[n : 2 * n]
    for i in range(n):
        omega = system.omega[i]
        for c in range(columns):
            rhs[i, c] = -2.0 * system.zeta[i] * omega * sens[n + i, c] - omega * omega * sens[i, c]
    add_linear(system, work, v, q, state[2 * n], sens, rhs)
    for e in range(system.phi.shape[0]):
        of_displacement(system, work, e, q, sens)
        work.dforce[:] = 0.0
        add(work.dforce, work.forces[e, 1], work.row)
        for i in range(n):
            add(work.dforce, system.phi[e, i] * work.forces[e, 2], sens[n + i])
        add_sliders(system, work, e, derivatives)
        for s in range(tables.first[e], tables.first[e + 1]):
            if not derivatives.sticks[s]:
                add(work.dforce, 1.0, sens[2 * n + 1 + s])
        add_laws_at(system, work, changes, e, q, v)
        add_dforce(system, work, e, v, rhs)


@inner_kernel
def add_laws_at(
    system: System, work: Workspace, changes: DerivativeTables, e: int, q: np.ndarray, v: np.ndarray
) -> None:
    """Add the derivatives of an element's force at a sample by the numbers of its springs and dampers to ``work.dforce``."""
    begin, springs, dampers = law_columns(system), changes.springs.shape[0], changes.dampers.shape[0]
    x, rate = dot(q, system.phi[e]), dot(v, system.phi[e])
    for k in range(springs + dampers):
        if changes.element[k] != e:
            continue
        if k < springs:
            work.dforce[begin + k] += spring_at(x, changes.springs[k], changes.limits[k])[0]
        else:
            work.dforce[begin + k] += damping_at(x, changes.dampers[k - springs], system.tables.limits[e, 0])[0] * rate


@inner_kernel
def law_columns(system: System) -> int:
    """Return the first column of the numbers of the laws."""
    n = system.omega.size
    return int(2 * n + n * system.inputs + system.phi.size)


@inner_kernel
def of_step(
    system: System,
    work: Workspace,
    changes: DerivativeTables,
    state: np.ndarray,
    half: np.ndarray,
    derivatives: Sensitivities,
    matrix: np.ndarray,
    rhs: np.ndarray,
) -> None:
    """Write the derivatives of the mean velocities of a step by the parameters; ``half`` gets the middle of the step.

    ``work.stuck`` gets the share of the step over which each slider sticks.
    """
    sens = derivatives.rows
    n, columns, h = system.omega.size, sens.shape[1], system.step_s
    q = state[:n]
    for i in range(n):
        half[i] = q[i] + 0.5 * h * work.mean[i]
        for c in range(columns):
            rhs[i, c] = 2.0 / h * sens[n + i, c] - system.omega[i] * system.omega[i] * sens[i, c]
        for k in range(n):
            matrix[i, k] = 0.0
        matrix[i, i] = work.effective_stiffness[i]
    add_linear(system, work, work.mean, half, state[2 * n], sens, rhs)
    for e in range(system.phi.shape[0]):
        of_displacement(system, work, e, q, sens)
        work.dforce[:] = 0.0
        add(work.dforce, work.forces[e, 1], work.row)
        begin_sticking(system, work, e, state, derivatives)
        add_sliders(system, work, e, derivatives)
        of_slips(system, work, e, derivatives)
        of_hystereses(system, work, e, state, derivatives)
        add_laws(system, work, changes, e, dot(q, system.phi[e]), state)
        add_dforce(system, work, e, work.mean, rhs)
        for i in range(n):
            for k in range(n):
                matrix[i, k] += work.forces[e, 2] * system.phi[e, i] * system.phi[e, k]
    solve(matrix, rhs, n, columns)


@inner_kernel
def begin_sticking(system: System, work: Workspace, e: int, state: np.ndarray, derivatives: Sensitivities) -> None:
    """Write the share of the step over which each slider of an element sticks; those that begin to stick get their rows."""
    n, tables = system.omega.size, system.tables
    for s in range(tables.first[e], tables.first[e + 1]):
        at = 2 * n + 1 + s
        stiffness = tables.sliders[s, 0]
        if tables.bent[e] and tables.bends[s, 1] != 0.0:
            continue
        work.stuck[s] = jenkins_step(state[at], stiffness, tables.sliders[s, 1], system.step_s * work.w[e])[3]
        if work.stuck[s] > 0.0 and not derivatives.sticks[s]:
            add(derivatives.rows[at], -stiffness, work.row)
            add(derivatives.sums[e], 1.0, derivatives.rows[at])
            derivatives.sticks[s] = True


@inner_kernel
def of_slips(system: System, work: Workspace, e: int, derivatives: Sensitivities) -> None:
    """Take what sliders lose that slip in this step from the derivatives of their forces, and end their sticking."""
    n, tables = system.omega.size, system.tables
    for s in range(tables.first[e], tables.first[e + 1]):
        if derivatives.sticks[s] and work.stuck[s] < 1.0:
            own = derivatives.rows[2 * n + 1 + s]
            add(work.dforce, (work.stuck[s] - 1.0) * tables.sliders[s, 0], work.row)
            add(work.dforce, work.stuck[s] - 1.0, own)
            add(derivatives.sums[e], -1.0, own)
            own[:] = 0.0
            derivatives.sticks[s] = False


@inner_kernel
def of_hystereses(system: System, work: Workspace, e: int, state: np.ndarray, derivatives: Sensitivities) -> None:
    """Add the derivatives of an element's mean forces through what its hystereses begin a step with to ``work.dforce``."""
    n, tables, way = system.omega.size, system.tables, system.step_s * work.w[e]
    to_rest = 0.5 * system.step_s * work.begun[e]
    if not tables.bent[e]:
        return
    for s in range(tables.first[e], tables.first[e + 1]):
        bend, at = tables.bends[s], 2 * n + 1 + s
        if bend[1] < 0.0:
            of_rest(system, e, state, derivatives, derivatives.rows[at])
        if bend[1] != 0.0:
            r = memory_of(state[at], bend, to_rest)
            by_r = hysteresis_step(r, tables.sliders[s, 0], tables.sliders[s, 1], bend[0], bend[1], bend[2], way)[3]
            add(work.dforce, by_r, derivatives.rows[at])


@inner_kernel
def of_rest(system: System, e: int, state: np.ndarray, derivatives: Sensitivities, row: np.ndarray) -> None:
    """Write the derivatives of the way after which a step of an element ends at rest."""
    n, half = system.omega.size, 0.5 * system.step_s
    begin = 2 * n + n * system.inputs + e * n
    row[:] = 0.0
    for i in range(n):
        add(row, half * system.phi[e, i], derivatives.rows[n + i])
        row[begin + i] += half * state[n + i]


@inner_kernel
def add_laws(system: System, work: Workspace, changes: DerivativeTables, e: int, x: float, state: np.ndarray) -> None:
    """Add the derivatives of an element's mean force over a step from ``x`` by the numbers of its laws to ``work.dforce``."""
    n, h = system.omega.size, system.step_s
    begin, way, reach = law_columns(system), h * work.w[e], system.tables.limits[e, 0]
    springs, dampers, tables = changes.springs.shape[0], changes.dampers.shape[0], system.tables
    for k in range(springs + dampers):
        if changes.element[k] != e:
            continue
        if k < springs:
            work.dforce[begin + k] += mean_spring(x, way, changes.springs[k], changes.limits[k])[0]
        else:
            work.dforce[begin + k] += damping_at(x + 0.5 * way, changes.dampers[k - springs], reach)[0] * work.w[e]
    begin, sign = begin + springs + dampers, math.copysign(1.0, way)
    for k in range(changes.sliders.shape[0]):
        if changes.element[springs + dampers + k] != e:
            continue
        total = 0.0
        for s in range(changes.first[k], changes.last[k]):
            by, share = changes.sliders[k, s], work.stuck[s]
            if tables.bent[e] and tables.bends[s, 1] != 0.0:
                r, by_bend = (
                    memory_of(state[2 * n + 1 + s], tables.bends[s], 0.5 * h * work.begun[e]),
                    changes.bends[k, s],
                )
                total += hysteresis_by(r, tables.sliders[s], tables.bends[s], by, by_bend, way)[0]
                continue
            total += sign * (1.0 - share) * by[1] + 0.5 * share * share * way * by[0]
        work.dforce[begin + k] += total


@inner_kernel
def end_sliders(
    system: System,
    work: Workspace,
    changes: DerivativeTables,
    state: np.ndarray,
    derivatives: Sensitivities,
    rhs: np.ndarray,
) -> None:
    """Take the derivatives of the sliders by the numbers of their joints, and of hystereses by all, to the end of the step.

    ``rhs``: derivatives of the mean velocities of the step.
    """
    n, h, tables = system.omega.size, system.step_s, system.tables
    end_hystereses(system, work, state, derivatives, rhs)
    joints = changes.springs.shape[0] + changes.dampers.shape[0]
    for k in range(changes.sliders.shape[0]):
        e, column = changes.element[joints + k], law_columns(system) + joints + k
        way, to_rest = h * work.w[e], 0.5 * h * work.begun[e]
        for s in range(changes.first[k], changes.last[k]):
            by, own = changes.sliders[k, s], derivatives.rows[2 * n + 1 + s]
            if tables.bent[e] and tables.bends[s, 1] != 0.0:
                r, by_bend = memory_of(state[2 * n + 1 + s], tables.bends[s], to_rest), changes.bends[k, s]
                own[column] += hysteresis_by(r, tables.sliders[s], tables.bends[s], by, by_bend, way)[1]
            elif derivatives.sticks[s]:
                own[column] += way * by[0]
                derivatives.sums[e, column] += way * by[0]
            else:
                own[column] = math.copysign(1.0, way) * by[1]


@inner_kernel
def end_hystereses(
    system: System, work: Workspace, state: np.ndarray, derivatives: Sensitivities, rhs: np.ndarray
) -> None:
    """Take the derivatives of hystereses to the end of the step, but for those by their own numbers in it."""
    n, h, tables = system.omega.size, system.step_s, system.tables
    for e in range(system.phi.shape[0]):
        begin, ready = 2 * n + n * system.inputs + e * n, False
        if not tables.bent[e]:
            continue
        for s in range(tables.first[e], tables.first[e + 1]):
            bend, at = tables.bends[s], 2 * n + 1 + s
            if bend[1] == 0.0:
                continue
            if not ready:  # the derivatives of the element's rate
                work.row[:] = 0.0
                for i in range(n):
                    add(work.row, system.phi[e, i], rhs[i])
                    work.row[begin + i] += work.mean[i]
                ready = True
            r = memory_of(state[at], bend, 0.5 * h * work.begun[e])
            _, _, _, _, by_way, by_r = hysteresis_step(
                r, tables.sliders[s, 0], tables.sliders[s, 1], bend[0], bend[1], bend[2], h * work.w[e]
            )
            own = derivatives.rows[at]
            for c in range(own.size):
                own[c] = by_r * own[c] + by_way * h * work.row[c]


@inner_kernel
def end_sensitivities(system: System, half: np.ndarray, sens: np.ndarray, rhs: np.ndarray, row: np.ndarray) -> None:
    """Take the sensitivities of displacements, velocities and support to the end of the step."""
    n, h, inputs = half.size, system.step_s, system.inputs
    alpha, last = 0.5 * h * system.support[1], sens.shape[0] - 1
    row[:] = 0.0
    for i in range(n):
        add(row, system.b[i, 0], sens[i])
        add(row, 0.5 * h * system.b[i, 0], rhs[i])
        add(sens[i], h, rhs[i])
        for c in range(sens.shape[1]):
            sens[n + i, c] = 2.0 * rhs[i, c] - sens[n + i, c]
    if alpha == 0.0:
        add(sens[last], h, row)
    else:
        for c in range(sens.shape[1]):
            before = sens[last, c]
            sens[last, c] = ((1.0 - alpha) * before + 2.0 * alpha * row[c]) / (1.0 + alpha)
            sens[2 * n, c] = ((1.0 - alpha) * sens[2 * n, c] + alpha * (before + sens[last, c])) / (1.0 + alpha)
    for i in range(n):
        if alpha == 0.0:
            sens[last, 2 * n + i * inputs] += h * half[i]
            continue
        change = 2.0 * alpha * half[i] / (1.0 + alpha)
        sens[last, 2 * n + i * inputs] += change
        sens[2 * n, 2 * n + i * inputs] += alpha * change / (1.0 + alpha)


@unlocked_kernel
def run_with_sensitivities(
    system: System,
    work: Workspace,
    changes: DerivativeTables,
    u: np.ndarray,
    state: np.ndarray,
    states: np.ndarray,
    outputs: np.ndarray,
    motions: np.ndarray,
    counted_from: int,
    derivatives: Sensitivities,
    matrix: np.ndarray,
    rhs: np.ndarray,
    jacobian: np.ndarray,
) -> None:
    """As `run`, and write the derivatives of ``outputs . motion`` by the parameters from sample ``counted_from``.

    Parameters, in this order: omega, zeta, b of the model's inputs (row by row), phi (row by row), the numbers of the laws as
    in `DerivativeTables`, zeros if there is work, the support's stiffness. ``derivatives``: those of the state.
    ``motions``: 0, 1, 2 for displacement, velocity, acceleration. ``matrix``: work, [n + 1, n]. ``rhs``: work, [n, P].
    ``jacobian``: [N - counted_from, n_outputs, P], zero at first.
    """
    n = system.omega.size
    q, v, r, half = state[:n], state[n : 2 * n], state[2 * n + 1 :], matrix[n]
    sens = derivatives.rows
    for sample in range(states.shape[0]):
        first = sample * system.steps
        take_input(system, work, u, first, first, state[2 * n])
        accelerate(system, work, q, v, r, states[sample, 2])
        for i in range(n):
            states[sample, 0, i], states[sample, 1, i] = q[i], v[i]
        if sample >= counted_from:
            of_acceleration(system, work, changes, state, derivatives, rhs)
            for o in range(outputs.shape[0]):
                out = jacobian[sample - counted_from, o]  # zero so far
                for i in range(n):
                    add(out, outputs[o, i], rhs[i] if motions[o] == 2 else sens[motions[o] * n + i])
        for row in range(first, first + system.steps):
            take_input(system, work, u, row, row + 1, state[2 * n])
            take_step(system, work, q, v, r)
            of_step(system, work, changes, state, half, derivatives, matrix, rhs)
            end_sliders(system, work, changes, state, derivatives, rhs)
            end_sensitivities(system, half, sens, rhs, work.row)
            end_step(system, work, q, v, state)
