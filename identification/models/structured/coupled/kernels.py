"""Compiled run of a structured model whose force reacts to its own motion."""

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
from identification.models.structured.steps import Room, System, accelerate, along, end_step, take_input, take_step
from vibrolock.compiled import inner_kernel, unlocked_kernel


@inner_kernel
def clear(values: np.ndarray) -> None:
    """Write zeros."""
    for i in range(values.size):
        values[i] = 0.0


@inner_kernel
def copy(values: np.ndarray, out: np.ndarray) -> None:
    """Write the same values into another array."""
    for i in range(values.size):
        out[i] = values[i]


@inner_kernel
def drive_output(
    system: System, room: Room, u: np.ndarray, k: int, state: np.ndarray, out: np.ndarray, row: np.ndarray, order: int
) -> float:
    """Write displacement, velocity and acceleration [3, n] under the force ``u[k]``; return the output at the drive point.

    ``row``: shapes of the output, and its direct part.
    """
    n = system.omega.size
    take_input(system, room, u, k, k, state[2 * n])
    accelerate(system, room, state[:n], state[n : 2 * n], state[2 * n + 1 :], out[2])
    for i in range(n):
        out[0, i], out[1, i] = state[i], state[n + i]
    return along(out[order], row[:n]) + float(row[n]) * float(u[k, 0])


@unlocked_kernel
def run_coupled(
    system: System,
    room: Room,
    loop: Loop,
    gain: float,
    order: int,
    row: np.ndarray,
    given: np.ndarray,
    xi: np.ndarray,
    after: np.ndarray,
    state: np.ndarray,
    before: np.ndarray,
    states: np.ndarray,
    u: np.ndarray,
    motion: np.ndarray,
) -> int:
    """Simulate from rest with one step a sample. The force is ``given`` (float[N]) plus the reaction to the drive point.

    Writes ``states`` [N, 3, n], the force ``u`` [N, 1] and ``motion`` (float[N], the output at the drive point); ``xi``,
    ``after`` (float[n_xi]), ``state`` and ``before`` [`System.size`] are work arrays. The force at the end of a step acts on
    that step and on the output there: it is the solution of a scalar equation, found by the secant method that begins with
    the ``gain`` of the linear part. Returns N, or the first sample at which no force is found.
    """
    n, count = system.omega.size, given.size
    largest = largest_of(given)
    clear(state)
    clear(xi)
    room.unsolved[0] = 0
    new = 0.0
    for k in range(count):
        free = free_force(loop, xi, given[k])
        copy(state, before)
        at, short, slope, found = 0.0, 0.0, 1.0 - loop.d * gain, False
        for trial in range(ITERATIONS):
            u[k, 0] = new
            copy(before, state)
            if k > 0:
                take_input(system, room, u, k - 1, k, state[2 * n])
                take_step(system, room, state[:n], state[n : 2 * n], state[2 * n + 1 :])
                end_step(system, room, state[:n], state[n : 2 * n], state)
            motion[k] = drive_output(system, room, u, k, state, states[k], row, order)
            left = new - free - loop.d * motion[k]
            if abs(left) <= EXACT * (abs(new) + largest):
                found = True
                break
            following, slope = secant_step(trial, new, left, at, short, slope)
            if slope == 0.0:
                break
            at, short, new = new, left, following
        if not found or not np.isfinite(motion[k]):
            return int(k)
        advance_filter(loop, xi, after, motion[k])
    return int(count)
