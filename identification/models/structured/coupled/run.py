"""Simulate a structured model together with an identified exciter, from the recorded voltage.

The scheme is that of `pnlss_coupled_run`, at the rate of the model's steps. The force at the end of a step reacts to the motion
there, so that the energy balance of the steps holds with the force that acts.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.exciter_coupling.channels import DrivePoint, drive_point
from identification.exciter_coupling.exciter import Exciter
from identification.exciter_coupling.passes import Passes
from identification.exciter_coupling.reaction import Reaction
from identification.linear.subspace import StateSpace
from identification.models.structured.coupled.kernels import run_coupled
from identification.models.structured.model import Motion, StructuredModel, ends_of_steps, motion_of, room_for
from identification.models.structured.steady.setting_up import resonance_hz
from vibrolock.arrays import Float

_COARSER = (6, 4, 3, 2)
"""Numbers of steps in a sample that are tried where the model's own allows no filter for the reaction."""
_GUESSED = 0.5
"""Default lowest frequency relative to the resonance of small vibrations."""


class CoupledMotion(Motion):
    """A simulated run of a structured model with its exciter: the fields of `Motion`."""


def structured_coupled_run(
    model: StructuredModel, exciter: Exciter, voltage_v: ArrayLike, *, lowest_hz: float | None = None
) -> CoupledMotion:
    """Simulate a structured model with the exciter at its force input, both from rest, under a recorded voltage.

    Parameters
    ----------
    model
        Model with one force as its only input, and the drive-point motion among its outputs.
    exciter
        Exciter identified on the same rig. It applies no static force; that of its suspension is the model's support.
    voltage_v
        float[n], recorded voltage at the model's sample rate, not corrected for the voltage path.
    lowest_hz
        Frequency above which the exciter's reaction is exact; below it the reaction fades. Default: half the resonance of
        small vibrations.

    Raises
    ------
    IdentificationError
        If values are NaN or infinite, the model lacks these channels, or no stable filter for the reaction is found.
    """
    at = drive_point(model, model.sample_rate_hz, voltage_v, lowest_hz, lambda: _GUESSED * resonance_hz(model))
    model, linear, passes, coarser = _with_filter(model, exciter, at)

    system, count, loop = model.system, passes.count, passes.loop
    system = system._replace(steps=1)
    states, u, motion = np.empty((count, 3, len(model.omega))), np.empty((count, 1)), np.empty(count)
    shape = np.append(model.output_shapes[at.output], model.direct[at.output, at.row])
    xi, after = np.empty(loop.b.size), np.empty(loop.b.size)
    state, before, room = np.empty(system.size), np.empty(system.size), room_for(system)
    gain = float(linear.d[at.output, at.row])

    def simulate(given: Float) -> int:
        return int(
            run_coupled(system, room, loop, gain, at.order, shape, given, xi, after, state, before, states, u, motion)
        )

    reached, repeats, change = passes.run(simulate, u[:, 0], motion)
    states, force = states[: passes.n : model.steps], u[: passes.n : model.steps, 0]
    valid = -(-reached // model.steps)
    states[valid:], force[valid:] = np.nan, np.nan
    found = motion_of(model, force[None], states, int(room.unsolved[0]))
    known = {name: value for name, value in vars(found).items() if name not in ("force_n", "passes", "change", "notes")}
    return CoupledMotion(
        **known,
        force_n=force,
        passes=repeats,
        change=change,
        notes=(*coarser, *passes.notes(reached, repeats, change)),
    )


def _with_filter(
    model: StructuredModel, exciter: Exciter, at: DrivePoint
) -> tuple[StructuredModel, StateSpace, Passes, tuple[str, ...]]:
    """Return the model, its linear part, and the passes with a filter for the reaction at the rate of the model's steps.

    Where there is none, steps are longer. Raises `IdentificationError` if that does not help.
    """
    failed: IdentificationError | None = None
    for steps in (model.steps, *(fewer for fewer in _COARSER if fewer < model.steps)):
        coarse = model.with_steps(steps)
        linear = _linear_part(coarse)
        fine = np.ascontiguousarray(ends_of_steps(at.voltage_v[None], steps)[:-1, 0])
        reaction = Reaction(exciter, at.order, at.lowest_hz, model.sample_rate_hz * steps)
        try:
            passes = Passes(reaction, linear, at.row, at.output, fine)
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
    drag = np.diag(2.0 * system.zeta * system.omega)
    moving = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(system.omega**2), -drag]])
    pushed = np.vstack([np.zeros_like(system.b), system.b])
    shown = np.stack([np.eye(2 * n)[:n], np.eye(2 * n)[n:], moving[n:]])[at_rest.motions]  # [n_outputs, n, 2 n]
    c = np.einsum("om,omx->ox", at_rest.output_shapes, shown)
    d = at_rest.direct + (at_rest.motions == 2)[:, None] * (at_rest.output_shapes @ system.b)
    inverse = np.linalg.inv(np.eye(2 * n) - 0.5 * h * moving)
    b = h * inverse @ pushed
    return StateSpace(inverse @ (np.eye(2 * n) + 0.5 * h * moving), b, c @ inverse, d + 0.5 * c @ b)
