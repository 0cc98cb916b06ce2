"""Compiled run of a structured model with the exact derivatives of its outputs, forward in time."""

import math

import numpy as np

from identification.structured.laws import damping_basis, element_basis, spring_basis
from identification.structured.steps import (
    Room,
    System,
    accelerate,
    along,
    end_step,
    rigidity,
    solve,
    take_input,
    take_step,
)
from vibrolock.compiled import inner_kernel, unlocked_kernel

__all__ = ["run_with_sensitivities"]


@inner_kernel
def add_linear(
    system: System, room: Room, speed: np.ndarray, place: np.ndarray, mean: float, sens: np.ndarray, rhs: np.ndarray
) -> None:
    """Add the explicit derivatives of the forces on the modes at ``place`` and ``speed`` by omega, zeta, b and the support."""
    n, inputs, support = place.size, room.u.size, system.support
    last = rhs.shape[1] - 1
    steep = 0.0
    if support[2] > 0.0:
        steep = 1.0 - math.tanh(support[0] * mean / support[2]) ** 2
    for i in range(n):
        rhs[i, i] -= 2.0 * system.zeta[i] * speed[i] + 2.0 * system.omega[i] * place[i]
        rhs[i, n + i] -= 2.0 * system.omega[i] * speed[i]
        for j in range(inputs):
            rhs[i, 2 * n + i * inputs + j] += room.u[j]
        if steep != 0.0:
            for c in range(last + 1):
                rhs[i, c] -= system.b[i, 0] * steep * support[0] * sens[2 * n, c]
            rhs[i, last] -= system.b[i, 0] * steep * mean


@inner_kernel
def add_direction(system: System, room: Room, e: int, speed: np.ndarray, place: np.ndarray, rhs: np.ndarray) -> None:
    """Add the explicit derivatives of an element's force on the modes by its direction."""
    n = place.size
    begin = 2 * n + n * room.u.size + e * n
    for k in range(n):
        rhs[k, begin + k] -= room.forces[e, 0]
        change = room.forces[e, 1] * place[k] + room.forces[e, 2] * speed[k]
        for i in range(n):
            rhs[i, begin + k] -= system.phi[e, i] * change


@inner_kernel
def of_acceleration(
    system: System, room: Room, q: np.ndarray, v: np.ndarray, mean: float, sens: np.ndarray, rhs: np.ndarray
) -> None:
    """Write the derivatives of the accelerations at a sample by the parameters."""
    n, columns = q.size, sens.shape[1]
    for i in range(n):
        omega = system.omega[i]
        for c in range(columns):
            rhs[i, c] = -2.0 * system.zeta[i] * omega * sens[n + i, c] - omega * omega * sens[i, c]
    add_linear(system, room, v, q, mean, sens, rhs)
    begin = 2 * n + n * room.u.size + system.phi.size
    for e in range(system.phi.shape[0]):
        law, springs, reach = system.laws[e, : system.sizes[e, 1]], system.sizes[e, 0], system.limits[e, 0]
        z, rate = along(q, system.phi[e]), along(v, system.phi[e])
        for c in range(columns):
            change = 0.0
            for i in range(n):
                change += system.phi[e, i] * (room.forces[e, 1] * sens[i, c] + room.forces[e, 2] * sens[n + i, c])
            for i in range(n):
                rhs[i, c] -= system.phi[e, i] * change
        add_direction(system, room, e, v, q, rhs)
        for k in range(law.size):
            if k < springs:
                change = spring_basis(z, k, law, springs, reach, system.limits[e, 1])[0]
            else:
                change = damping_basis(z, k - springs, reach) * rate
            for i in range(n):
                rhs[i, begin + k] -= system.phi[e, i] * change
        begin += law.size


@inner_kernel
def of_step(
    system: System,
    room: Room,
    q: np.ndarray,
    v: np.ndarray,
    half: np.ndarray,
    mean: float,
    sens: np.ndarray,
    matrix: np.ndarray,
    rhs: np.ndarray,
) -> None:
    """Write the derivatives of the mean velocities of a step by the parameters; ``half`` gets the middle of the step."""
    n, columns, h = q.size, sens.shape[1], system.step_s
    for i in range(n):
        half[i] = q[i] + 0.5 * h * room.mean[i]
        for c in range(columns):
            rhs[i, c] = 2.0 / h * sens[n + i, c] - system.omega[i] * system.omega[i] * sens[i, c]
        for k in range(n):
            matrix[i, k] = 0.0
        matrix[i, i] = rigidity(system, i)
    add_linear(system, room, room.mean, half, mean, sens, rhs)
    begin = 2 * n + n * room.u.size + system.phi.size
    for e in range(system.phi.shape[0]):
        law, springs = system.laws[e, : system.sizes[e, 1]], system.sizes[e, 0]
        z = along(q, system.phi[e])
        for c in range(columns):
            change = 0.0
            for i in range(n):
                change += system.phi[e, i] * sens[i, c]
            change *= room.forces[e, 1]
            for i in range(n):
                rhs[i, c] -= system.phi[e, i] * change
        add_direction(system, room, e, room.mean, q, rhs)
        for i in range(n):
            for k in range(n):
                matrix[i, k] += room.forces[e, 2] * system.phi[e, i] * system.phi[e, k]
        for k in range(law.size):
            change = element_basis(z, room.w[e], h, k, law, springs, system.limits[e, 0], system.limits[e, 1])
            for i in range(n):
                rhs[i, begin + k] -= system.phi[e, i] * change
        begin += law.size
    solve(matrix, rhs, n, columns)


@inner_kernel
def end_sensitivities(system: System, half: np.ndarray, sens: np.ndarray, rhs: np.ndarray) -> None:
    """Take the sensitivities of the state to the end of the step."""
    n, h, inputs = half.size, system.step_s, system.b.shape[1]
    alpha = 0.5 * h * system.support[1]
    for c in range(sens.shape[1]):
        moved = 0.0
        for i in range(n):
            moved += system.b[i, 0] * (sens[i, c] + 0.5 * h * rhs[i, c])
            sens[i, c] += h * rhs[i, c]
            sens[n + i, c] = 2.0 * rhs[i, c] - sens[n + i, c]
        sens[2 * n, c] = ((1.0 - alpha) * sens[2 * n, c] + 2.0 * alpha * moved) / (1.0 + alpha)
    for i in range(n):
        sens[2 * n, 2 * n + i * inputs] += 2.0 * alpha * half[i] / (1.0 + alpha)


@unlocked_kernel
def run_with_sensitivities(
    system: System,
    room: Room,
    u: np.ndarray,
    state: np.ndarray,
    states: np.ndarray,
    outputs: np.ndarray,
    motions: np.ndarray,
    counted_from: int,
    sens: np.ndarray,
    matrix: np.ndarray,
    rhs: np.ndarray,
    jacobian: np.ndarray,
) -> None:
    """As `run`, and write the derivatives of ``outputs . motion`` by the parameters from sample ``counted_from``.

    Parameters, in this order: omega, zeta, b (row by row), phi (row by row), the laws, the support's stiffness. ``sens``:
    [2 n + 1, P], that of the state. ``motions``: 0, 1, 2 for displacement, velocity, acceleration of an output. ``matrix``:
    room, [n + 1, n]. ``rhs``: room, [n, P]. ``jacobian``: [N - counted_from, n_outputs, P].
    """
    n = system.omega.size
    q, v, half = state[:n], state[n : 2 * n], matrix[n]
    for sample in range(states.shape[0]):
        first = sample * system.steps
        take_input(system, room, u, first, first, state[2 * n])
        accelerate(system, room, q, v, states[sample, 2])
        for i in range(n):
            states[sample, 0, i], states[sample, 1, i] = q[i], v[i]
        if sample >= counted_from:
            of_acceleration(system, room, q, v, state[2 * n], sens, rhs)
            for o in range(outputs.shape[0]):
                for c in range(sens.shape[1]):
                    total = 0.0
                    for i in range(n):
                        total += outputs[o, i] * (rhs[i, c] if motions[o] == 2 else sens[motions[o] * n + i, c])
                    jacobian[sample - counted_from, o, c] = total
        for row in range(first, first + system.steps):
            take_input(system, room, u, row, row + 1, state[2 * n])
            take_step(system, room, q, v)
            of_step(system, room, q, v, half, state[2 * n], sens, matrix, rhs)
            end_sensitivities(system, half, sens, rhs)
            end_step(system, room, q, v, state)
