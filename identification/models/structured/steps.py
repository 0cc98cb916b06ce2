"""Compiled run of a structured model: implicit midpoint rule with discrete gradients.

A step of length h from (q, v) has the mean velocity V and the end ``q + h V``, ``2 V - v``:

    ``2 (V - v)/h + C V + K (q + h V/2) + sum_e phi_e F_e = B U``

    ``F_e = (P_e(x + h w) - P_e(x))/(h w) + c_e(x + h w/2) w + R_e``,  ``x = phi_e . q``,  ``w = phi_e . V``

with the mean input U, the potential P_e of a spring, its damping c_e and the mean force R_e of its sliders along the way. Over
a step the mechanical energy, with ``r^2/(2 k)`` of each slider, then changes by the work of U less that of dampers and
friction, exactly (the discrete gradient of Gonzalez, J. Nonlinear Sci. 6, 1996), whatever h is.
"""

import math
from typing import NamedTuple

import numpy as np

from identification.models.structured.elements import Tables
from identification.models.structured.hysteresis import memory_of, slider_step
from identification.models.structured.kernels import damping_at, jenkins_step, spring_at, step_force
from vibrolock.compiled import inner_kernel, unlocked_kernel

NEWTON = 60  # iterations at most; a step that is not solved by then is counted
CAREFUL = 12  # iterations with whole steps; those after them are halved
CLOSE = 1e-7  # change of w that ends Newton's iteration, relative to the velocities it is made of: its square is left
SMALL = 0.01  # weight of displacement over step among them


class System(NamedTuple):
    """Numbers of a model; elements have no unit: their displacements are relative to their own scale, their forces J."""

    step_s: float
    steps: int
    """In a sample."""
    omega: np.ndarray
    """float[n], rad/s."""
    zeta: np.ndarray
    """float[n]."""
    b: np.ndarray
    """float[n, n_inputs]: shapes at the inputs, the model's first."""
    inputs: int
    """Number of the model's inputs; further columns are nudging inputs."""
    phi: np.ndarray
    """float[n_elements, n]."""
    tables: Tables
    """Springs, dampers and sliders of the elements."""
    support: np.ndarray
    """float[3]: stiffness (N/m), corner of its filter (rad/s; 0: its force is held) and largest force (N) of the support."""

    @property
    def size(self) -> int:
        """Size of the state: displacements, velocities, the support's filter, sliders, first stage of the filter."""
        return 2 * len(self.omega) + 2 + len(self.tables.sliders)


def nudged(system: System, rate: np.ndarray) -> System:
    """Return the system with more damping, and with one more input for each mode."""
    return system._replace(zeta=system.zeta + 0.5 * rate / system.omega, b=np.hstack([system.b, np.diag(rate)]))


class Workspace(NamedTuple):
    """Workspace for a step, so that nothing is allocated."""

    effective_stiffness: np.ndarray
    """float[n]: what multiplies the mean velocity of a mode in the equation of a step."""
    compliance: np.ndarray
    """float[n_elements, n]: mean velocity of a mode by the force of an element."""
    shared: np.ndarray
    """float[n_elements, n_elements]: rate of an element by the force of another."""
    mean: np.ndarray
    free: np.ndarray
    u: np.ndarray
    w: np.ndarray
    begun: np.ndarray
    """float[n_elements]: rate of each element at the beginning of the step."""
    forces: np.ndarray
    coupling: np.ndarray
    change: np.ndarray
    row: np.ndarray
    dforce: np.ndarray
    """float[P] each: of the sensitivities."""
    stuck: np.ndarray
    """float[n_sliders]: share of a step over which each sticks, of the sensitivities."""
    unsolved: np.ndarray
    """int[1]: steps whose equation was not solved."""


@inner_kernel
def solve(matrix: np.ndarray, rhs: np.ndarray, n: int, columns: int) -> None:
    """Solve in place by elimination with row exchange; ``rhs`` gets the solution, ``matrix`` is destroyed."""
    for i in range(n):
        best = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[best, i]):
                best = r
        if best != i:
            for c in range(n):
                matrix[i, c], matrix[best, c] = matrix[best, c], matrix[i, c]
            for c in range(columns):
                rhs[i, c], rhs[best, c] = rhs[best, c], rhs[i, c]
        pivot = 1.0 / matrix[i, i]
        for r in range(i + 1, n):
            factor = matrix[r, i] * pivot
            if factor != 0.0:
                for c in range(i + 1, n):
                    matrix[r, c] -= factor * matrix[i, c]
                for c in range(columns):
                    rhs[r, c] -= factor * rhs[i, c]
    for i in range(n - 1, -1, -1):
        for r in range(i + 1, n):
            for c in range(columns):
                rhs[i, c] -= matrix[i, r] * rhs[r, c]
        pivot = 1.0 / matrix[i, i]
        for c in range(columns):
            rhs[i, c] *= pivot


@inner_kernel
def dot(vector: np.ndarray, row: np.ndarray) -> float:
    """Return the scalar product."""
    total = 0.0
    for i in range(vector.size):
        total += vector[i] * row[i]
    return float(total)


@inner_kernel
def take_step(system: System, work: Workspace, q: np.ndarray, v: np.ndarray, r: np.ndarray) -> None:
    """Solve a step under the mean input ``work.u``: write the mean velocity, and what every element does at the solution."""
    h, elements = system.step_s, system.phi.shape[0]
    for i in range(q.size):
        push = 2.0 * v[i] / h - system.omega[i] * system.omega[i] * q[i] + dot(work.u, system.b[i])
        work.free[i] = push / work.effective_stiffness[i]
        work.mean[i] = work.free[i]
    for e in range(elements):
        work.begun[e] = work.w[e] = dot(v, system.phi[e])
    solved = elements == 0
    for iteration in range(NEWTON if elements else 0):
        if newton(system, work, q, r, 1.0 if iteration < CAREFUL else 0.5):
            solved = True
            break
    if not solved:
        work.unsolved[0] += 1
    for e in range(elements):
        for i in range(q.size):
            work.mean[i] -= work.compliance[e, i] * work.forces[e, 0]


@inner_kernel
def evaluate(system: System, work: Workspace, q: np.ndarray, r: np.ndarray, e: int) -> None:
    """Write the mean force of an element over the step, and its derivatives by x and the rate."""
    h, tables = system.step_s, system.tables
    x = dot(q, system.phi[e])
    force, by_x, by_w = step_force(x, work.w[e], h, tables.springs[e], tables.dampers[e], tables.limits[e])
    for s in range(tables.first[e], tables.first[e + 1]):
        mean, _, by_way = joint_step(tables, e, s, r[s], h * work.w[e], 0.5 * h * work.begun[e])
        force += mean
        by_w += h * by_way
    work.forces[e, 0], work.forces[e, 1], work.forces[e, 2] = force, by_x, by_w


@inner_kernel
def joint_step(tables: Tables, e: int, s: int, r: float, way: float, to_rest: float) -> tuple[float, float, float]:
    """Move a slider of an element as `slider_step` does; after the way ``to_rest`` a step ends at rest."""
    if tables.bent[e]:
        return slider_step(memory_of(r, tables.bends[s], to_rest), tables.sliders[s], tables.bends[s], way)
    mean, end, by_way, _ = jenkins_step(r, tables.sliders[s, 0], tables.sliders[s, 1], way)
    return mean, end, by_way


@inner_kernel
def is_dry(tables: Tables, e: int) -> bool:
    """Return whether an element has dry friction."""
    dry = False
    for s in range(tables.first[e], tables.first[e + 1]):
        dry = dry or tables.bends[s, 1] < 0.0
    return dry


@inner_kernel
def up_to_steps(w: float, change: float, to_rest: float) -> float:
    """Return the change of a rate up to the next step of dry friction: at no rate, or at that with which it comes to rest."""
    for at in (0.0, to_rest):
        if (w - at) * (w + change - at) < 0.0:
            change = at - w
    return change


@inner_kernel
def newton(system: System, work: Workspace, q: np.ndarray, r: np.ndarray, share: float) -> bool:
    """Correct mean velocities of all elements once, and their forces along the tangents; return whether the change is small."""
    elements = work.w.size
    for e in range(elements):
        evaluate(system, work, q, r, e)
    for e in range(elements):
        miss = dot(work.free, system.phi[e]) - work.w[e]
        for f in range(elements):
            miss -= work.shared[e, f] * work.forces[f, 0]
            work.coupling[e, f] = work.shared[e, f] * work.forces[f, 2] + (1.0 if e == f else 0.0)
        work.change[e, 0] = miss
    solve(work.coupling, work.change, elements, 1)
    done = True
    for e in range(elements):
        size = abs(work.w[e])
        for i in range(q.size):
            size += abs(system.phi[e, i]) * (abs(work.free[i]) + SMALL * abs(q[i]) / system.step_s)
        if abs(work.change[e, 0]) > CLOSE * size + 1e-300:
            done = False
    for e in range(elements):
        change = work.change[e, 0] * (1.0 if done else share)  # the last one is taken whole
        if not done and is_dry(system.tables, e):
            change = up_to_steps(work.w[e], change, 0.5 * work.begun[e])
        work.w[e] += change
        work.forces[e, 0] += change * work.forces[e, 2]
    return done


@inner_kernel
def accelerate(system: System, work: Workspace, q: np.ndarray, v: np.ndarray, r: np.ndarray, out: np.ndarray) -> None:
    """Write the acceleration under ``work.u``, and force of every element with its derivatives by x and its rate."""
    tables = system.tables
    for i in range(q.size):
        omega = system.omega[i]
        out[i] = dot(work.u, system.b[i]) - 2.0 * system.zeta[i] * omega * v[i] - omega * omega * q[i]
    for e in range(system.phi.shape[0]):
        x, rate = dot(q, system.phi[e]), dot(v, system.phi[e])
        force, slope, _ = spring_at(x, tables.springs[e], tables.limits[e])
        damping, steep = damping_at(x, tables.dampers[e], tables.limits[e, 0])
        for s in range(tables.first[e], tables.first[e + 1]):
            force += r[s]
        work.forces[e, 0] = force + damping * rate
        work.forces[e, 1], work.forces[e, 2] = slope + steep * rate, damping
        for i in range(q.size):
            out[i] -= system.phi[e, i] * work.forces[e, 0]


@inner_kernel
def take_input(system: System, work: Workspace, u: np.ndarray, row: int, other: int, mean: float) -> None:
    """Write the mean of two rows of the inputs, and add the support's force, bounded smoothly, to the first input.

    ``mean``: filtered displacement there.
    """
    support = system.support
    for j in range(u.shape[1]):
        work.u[j] = 0.5 * (u[row, j] + u[other, j])
    if support[2] > 0.0:
        work.u[0] -= support[2] * math.tanh(support[0] * mean / support[2])


@inner_kernel
def end_step(system: System, work: Workspace, q: np.ndarray, v: np.ndarray, state: np.ndarray) -> None:
    """Go to the end of the step; sliders move, and the support's filter follows the displacement of the first input.

    While the force is held, the last state is the integral of that displacement (`frozen_support`).
    """
    alpha, there = 0.5 * system.step_s * system.support[1], 0.0
    tables, n = system.tables, q.size
    for e in range(system.phi.shape[0]):
        for s in range(tables.first[e], tables.first[e + 1]):
            at = 2 * n + 1 + s
            way, to_rest = system.step_s * work.w[e], 0.5 * system.step_s * work.begun[e]
            state[at] = joint_step(tables, e, s, state[at], way, to_rest)[1]
    for i in range(q.size):
        there += system.b[i, 0] * (q[i] + 0.5 * system.step_s * work.mean[i])
        q[i] += system.step_s * work.mean[i]
        v[i] = 2.0 * work.mean[i] - v[i]
    last = state.size - 1
    before = state[last]
    if alpha == 0.0:
        state[last] = before + system.step_s * there
        return
    state[last] = ((1.0 - alpha) * before + 2.0 * alpha * there) / (1.0 + alpha)
    state[2 * n] = ((1.0 - alpha) * state[2 * n] + alpha * (before + state[last])) / (1.0 + alpha)


@unlocked_kernel
def run(system: System, work: Workspace, u: np.ndarray, state: np.ndarray, states: np.ndarray) -> None:
    """Simulate from ``state`` [`System.size`] and write displacement, velocity and acceleration at every sample, [N, 3, n].

    ``u``: [N steps + 1, n_inputs], inputs at the ends of all steps.
    """
    n = system.omega.size
    q, v, r = state[:n], state[n : 2 * n], state[2 * n + 1 :]
    for sample in range(states.shape[0]):
        first = sample * system.steps
        take_input(system, work, u, first, first, state[2 * n])
        accelerate(system, work, q, v, r, states[sample, 2])
        for i in range(n):
            states[sample, 0, i], states[sample, 1, i] = q[i], v[i]
        for row in range(first, first + system.steps):
            take_input(system, work, u, row, row + 1, state[2 * n])
            take_step(system, work, q, v, r)
            end_step(system, work, q, v, state)
