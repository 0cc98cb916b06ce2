"""Simulate a structured model together with an identified exciter, from the recorded voltage.

The scheme is that of `Passes`, at the rate of the model's steps. The force at the end of a step reacts to the motion there, so
that the energy balance of the steps holds with the force that acts.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
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
from identification.exciter_coupling.passes import DrivePoint, Passes, drive_point
from identification.linear.subspace import StateSpace
from identification.models.structured.model import Motion, StructuredModel, motion_of, workspace_for
from identification.models.structured.nudging import ends_of_steps
from identification.models.structured.steps import System, Workspace, accelerate, dot, end_step, take_input, take_step
from identification.models.structured.trained_range import input_use
from identification.validation import finite_array
from vibrolock.arrays import Float
from vibrolock.compiled import inner_kernel, unlocked_kernel

_COARSER = (6, 4, 3, 2)
"""Numbers of steps in a sample that are tried where the model's own allows no filter for the reaction. Chosen."""


class CoupledMotion(Motion):
    """A simulated run of a structured model with its exciter: the fields of `Motion`."""


def coupled_run(
    model: StructuredModel,
    exciter: Exciter,
    voltage_v: ArrayLike,
    lowest_hz: float | None,
    default_hz: Callable[[], float],
) -> CoupledMotion:
    """Simulate both from rest, as `identification.coupled_run` describes; ``default_hz`` gives ``lowest_hz`` if it is None."""
    at = drive_point(model, model.sample_rate_hz, lowest_hz, default_hz)
    voltage = finite_array("voltage_v", voltage_v, np.float64, 1)
    model, linear, passes, coarser = _with_filter(model, exciter, at, voltage)

    system, count, loop = model.system, passes.count, passes.loop
    system = system._replace(steps=1)
    states, u, motion = np.empty((count, 3, len(model.omega))), np.zeros((count, 1)), np.empty(count)
    shape = np.append(model.output_shapes[at.output], model.direct[at.output, at.row])
    xi, after = np.empty(loop.b.size), np.empty(loop.b.size)
    state, before, work = np.empty(system.size), np.empty(system.size), workspace_for(system)
    gain = float(linear.d[at.output, at.row])

    def simulate(given: Float) -> int:
        return int(
            run_coupled(system, work, loop, gain, at.order, shape, given, xi, after, state, before, states, u, motion)
        )

    reached, repeats, change = passes.run(simulate, u[:, 0], motion)
    states, force = states[: passes.n : model.steps], u[: passes.n : model.steps, 0]
    valid = -(-reached // model.steps)
    states[valid:], force[valid:] = np.nan, np.nan
    found = motion_of(model, force[None], states, int(work.unsolved[0]))
    notes = (*coarser, *passes.notes(reached, repeats, change))
    with_exciter = {"force_n": force, "passes": repeats, "change": change, "notes": notes}
    if np.isfinite(force).all():
        with_exciter["input_use"] = np.array([input_use(model, force, settled=False)])
    return CoupledMotion(**(vars(found) | with_exciter))


def _with_filter(
    model: StructuredModel, exciter: Exciter, at: DrivePoint, voltage_v: Float
) -> tuple[StructuredModel, StateSpace, Passes, tuple[str, ...]]:
    """Return the model, its linear part, and the passes with a filter for the reaction at the rate of the model's steps.

    Where there is none, steps are longer. Raises `IdentificationError` if that does not help.
    """
    failed: IdentificationError | None = None
    for steps in (model.steps, *(fewer for fewer in _COARSER if fewer < model.steps)):
        coarse = replace(model, steps=steps)
        linear = _linear_part(coarse)
        fine = ends_of_steps(voltage_v[None], steps)[:-1, 0]
        try:
            passes = Passes(exciter, at, linear, model.sample_rate_hz * steps, fine)
        except IdentificationError as error:
            failed = failed or error
        else:
            said = () if steps == model.steps else (f"simulated with {steps} steps in a sample, not {model.steps}",)
            return coarse, linear, passes, said
    assert failed is not None
    raise failed


def _linear_part(model: StructuredModel) -> StateSpace:
    """Return small vibrations as the time steps see them, by the bilinear rule."""
    at_rest = replace(model.linearised(), sample_rate_hz=model.sample_rate_hz * model.steps, steps=1)
    system, n, h = at_rest.system, len(at_rest.omega), at_rest.step_s
    damping = np.diag(2.0 * system.zeta * system.omega)
    moving = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(system.omega**2), -damping]])
    pushed = np.vstack([np.zeros_like(system.b), system.b])
    shown = np.stack([np.eye(2 * n)[:n], np.eye(2 * n)[n:], moving[n:]])[at_rest.motions]  # [n_outputs, n, 2 n]
    c = np.einsum("om,omx->ox", at_rest.output_shapes, shown)
    d = at_rest.direct + (at_rest.motions == 2)[:, None] * (at_rest.output_shapes @ system.b)
    inverse = np.linalg.inv(np.eye(2 * n) - 0.5 * h * moving)
    b = h * inverse @ pushed
    return StateSpace(inverse @ (np.eye(2 * n) + 0.5 * h * moving), b, c @ inverse, d + 0.5 * c @ b)


@inner_kernel
def copy(values: np.ndarray, out: np.ndarray) -> None:
    """Write the same values into another array."""
    for i in range(values.size):
        out[i] = values[i]


@inner_kernel
def drive_output(
    system: System,
    work: Workspace,
    u: np.ndarray,
    k: int,
    state: np.ndarray,
    out: np.ndarray,
    row: np.ndarray,
    order: int,
) -> float:
    """Write displacement, velocity and acceleration [3, n] under the force ``u[k]``; return the output at the drive point.

    ``row``: shapes of the output, and its direct part.
    """
    n = system.omega.size
    take_input(system, work, u, k, k, state[2 * n])
    accelerate(system, work, state[:n], state[n : 2 * n], state[2 * n + 1 :], out[2])
    for i in range(n):
        out[0, i], out[1, i] = state[i], state[n + i]
    return dot(out[order], row[:n]) + float(row[n]) * float(u[k, 0])


@unlocked_kernel
def run_coupled(
    system: System,
    work: Workspace,
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
    that step and on the output there: it is the solution of a scalar equation, found by the secant method. This begins with
    the force that ``u`` holds from the pass before (zeros in the first one), changed as that of the last sample has, and with
    the slope found there; at first with the ``gain`` of the linear part. Returns N, or the first sample at which no force is
    found.
    """
    n, count = system.omega.size, given.size
    largest = largest_of(given)
    state[:], xi[:], work.unsolved[0] = 0.0, 0.0, 0
    changed, slope = 0.0, 1.0 - loop.d * gain
    for k in range(count):
        free = free_force(loop, xi, given[k])
        copy(state, before)
        at, short, found = 0.0, 0.0, False
        known = u[k, 0]
        new = known + changed
        for trial in range(ITERATIONS):
            u[k, 0] = new
            copy(before, state)
            if k > 0:
                take_input(system, work, u, k - 1, k, state[2 * n])
                take_step(system, work, state[:n], state[n : 2 * n], state[2 * n + 1 :])
                end_step(system, work, state[:n], state[n : 2 * n], state)
            motion[k] = drive_output(system, work, u, k, state, states[k], row, order)
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
        changed = new - known
        advance_filter(loop, xi, after, motion[k])
    return int(count)
