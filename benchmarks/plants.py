"""The plant of the virtual rig alone: by its own integrator, and by classic Runge-Kutta steps.

Both are compiled with the same care: in the Runge-Kutta steps the coordinates of the sites are integrated along with the state,
whose derivative gives theirs at no cost. Friction is committed once per sub-step.
"""

import numpy as np

from simulators import VirtualRig
from simulators.kernels import RigArrays, RigState, advance, aligned, combine, joint_forces, local_forces, pad
from vibrolock.arrays import Float
from vibrolock.compiled import kernel


@kernel
def integrate(rig: RigArrays, state: RigState, voltages: Float, internal: int) -> int:
    """``internal`` calls of `advance` per voltage; returns all flags, or-ed."""
    flags = 0
    for k in range(voltages.size):
        for _ in range(internal):
            flags |= advance(rig, state, voltages[k])
    return flags


def runge_kutta_arrays(rig: VirtualRig) -> tuple[RigArrays, RigState, Float, Float]:
    """Return rig and state at rest, the ``derivative`` [n_input, n_row], and ``work`` [3, n_row] of `runge_kutta`.

    The derivative maps ``[x, u, f]`` to the rates of the rows of a rig: coordinates of the sites, then the state.
    """
    arrays, state = rig.build()
    plant = rig.plant
    columns = np.column_stack([plant.dynamics, plant.voltage_column, plant.site_columns])
    rows = np.roll(plant.site_rows, len(rig.friction), axis=0)
    derivative = pad(np.vstack([rows @ columns, columns]).T)
    n_row = derivative.shape[1]
    return arrays, state._replace(rows=aligned(n_row)), derivative, aligned((3, n_row))


@kernel
def runge_kutta(
    rig: RigArrays,
    state: RigState,
    derivative: Float,
    work: Float,
    step_s: float,
    substeps: int,
    voltages: Float,
    out: Float,
) -> None:
    """Outputs (SI) into ``out`` [n, n_channel], then a sample of ``substeps`` steps with each of ``voltages`` [n] (V) held."""
    inputs, start, stage, slope, total = state.inputs, work[0], state.rows, work[1], work[2]
    n, n_local, n_joint = rig.plant[0].n_state, rig.plant[0].n_local, rig.plant[0].n_joint
    n_site = n_local + n_joint
    for sample in range(voltages.size):
        combine(rig.sense, inputs, state.outputs)
        for c in range(out.shape[1]):
            out[sample, c] = state.outputs[c]
        inputs[n] = voltages[sample]
        for _ in range(substeps):
            for i in range(start.size):
                stage[i] = start[i]
                total[i] = 0.0
            # Four stages, and a fifth look at the sites to commit what they came to.
            for k in range(5):
                joint_forces(rig, state, k == 4)
                local_forces(rig.sites, stage, n_joint, state.forces)
                for s in range(n_local):
                    inputs[n + 1 + s] = state.forces[s]
                for s in range(n_joint):
                    inputs[n + 1 + n_local + s] = state.joints[s]
                for i in range(n):
                    inputs[i] = stage[n_site + i]
                if k == 4:
                    break
                combine(derivative, inputs, slope)
                weight = step_s / 6.0 if k == 0 or k == 3 else step_s / 3.0
                ahead = step_s if k == 2 else 0.5 * step_s
                for i in range(start.size):
                    total[i] += weight * slope[i]
                    stage[i] = start[i] + (total[i] if k == 3 else ahead * slope[i])
            for i in range(start.size):
                start[i] = stage[i]
