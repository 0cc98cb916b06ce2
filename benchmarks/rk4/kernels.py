"""Classic fourth-order Runge-Kutta method on the plant of the virtual rig, friction committed once per sub-step.

Written with the same care for speed as the rig's own integrator, so that a comparison is fair: site coordinates are
integrated along with the state, whose derivative gives theirs at no cost.
"""

import numpy as np
from numpy.typing import NDArray

from benchmarks.rk4.arrays import Rk4Arrays, Rk4State
from simulators.kernels import combine, joint_forces, local_forces
from vibrolock.compiled import kernel


@kernel
def sample(rig: Rk4Arrays, state: Rk4State, voltage: float, out: NDArray[np.float64]) -> int:
    """Outputs (SI) into ``out`` [n_channel], then one sample with ``voltage`` (V) held; returns 0."""
    combine(rig.sense, state.inputs, state.outputs)
    for c in range(out.size):
        out[c] = state.outputs[c]
    inputs, start, stage, slope, total = state.inputs, state.start, state.rows, state.slope, state.total
    n, n_local, n_joint = rig.plant[0].n_state, rig.plant[0].n_local, rig.plant[0].n_joint
    n_site = n_local + n_joint
    h = rig.step_s[0]
    inputs[n] = voltage
    for _ in range(rig.substeps[0]):
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
            combine(rig.derivative, inputs, slope)
            weight = h / 6.0 if k == 0 or k == 3 else h / 3.0
            ahead = h if k == 2 else 0.5 * h
            for i in range(start.size):
                total[i] += weight * slope[i]
                stage[i] = start[i] + (total[i] if k == 3 else ahead * slope[i])
        for i in range(start.size):
            start[i] = stage[i]
    return 0


@kernel
def run(rig: Rk4Arrays, state: Rk4State, voltages: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """One sample per voltage: ``voltages`` [n] (V) in, ``out`` [n, n_channel] (SI) out."""
    for k in range(voltages.size):
        sample(rig, state, voltages[k], out[k])
