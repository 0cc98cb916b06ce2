"""Classic fourth-order Runge-Kutta method on the plant of the virtual rig, friction committed once per sub-step."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.rk4.arrays import Rk4Arrays, Rk4State
from simulators.plant.kernels import clip, combine, local_forces
from vibrolock.compiled import kernel


@kernel
def site_forces(rig: Rk4Arrays, state: Rk4State, n: int, commit: bool) -> None:
    """Site forces at ``state.stage`` into the input vector, which holds n states and the voltage before them."""
    combine(rig.coordinates, state.stage, state.rows)
    forces = state.inputs[n + 1 :]
    local_forces(rig.sites, state.rows, 0, forces)
    _, n_jenkins, n_element = rig.elements.shape
    for s in range(n_jenkins):
        z = state.rows[rig.sites.size + s]
        total = 0.0
        for e in range(n_element):
            force = state.friction[s, e] + rig.elements[0, s, e] * (z - state.deflection[s])
            force = clip(force, rig.elements[1, s, e])
            if commit:
                state.friction[s, e] = force
            total += force
        if commit:
            state.deflection[s] = z
        forces[rig.sites.size + s] = rig.stuck[s] * z - total


@kernel
def sample(rig: Rk4Arrays, state: Rk4State, voltage: float, out: NDArray[np.float64]) -> int:
    """Outputs (SI) into ``out`` [n_channel], then one sample with ``voltage`` (V) held; returns 0."""
    combine(rig.sense, state.inputs, state.outputs)
    for c in range(out.size):
        out[c] = state.outputs[c]
    inputs, stage, slope, total = state.inputs, state.stage, state.slope, state.total
    start, n, h = state.start, rig.n_state[0], rig.step_s[0]
    inputs[n] = voltage
    for _ in range(rig.substeps[0]):
        for i in range(n):
            start[i] = inputs[i]
            total[i] = 0.0
        for k in range(4):
            ahead = 0.0 if k == 0 else (h if k == 3 else 0.5 * h)
            for i in range(n):
                inputs[i] = start[i] if k == 0 else start[i] + ahead * slope[i]
                stage[i] = inputs[i]
            site_forces(rig, state, n, False)
            combine(rig.derivative, inputs, slope)
            weight = h / 6.0 if k in (0, 3) else h / 3.0
            for i in range(n):
                total[i] += weight * slope[i]
        for i in range(n):
            inputs[i] = start[i] + total[i]
            stage[i] = inputs[i]
        site_forces(rig, state, n, True)
    return 0


@kernel
def run(rig: Rk4Arrays, state: Rk4State, voltages: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """One sample per voltage: ``voltages`` [n] (V) in, ``out`` [n, n_channel] (SI) out."""
    for k in range(voltages.size):
        sample(rig, state, voltages[k], out[k])
