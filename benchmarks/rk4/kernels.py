"""Classic fourth-order Runge-Kutta method on the plant of the virtual rig, friction committed once per sub-step.

Written with the same care for speed as the rig's own integrator, so that a comparison is fair: site coordinates are
integrated along with the state, whose derivative gives theirs at no cost.
"""

import numpy as np
from numpy.typing import NDArray

from benchmarks.rk4.arrays import Rk4Arrays, Rk4State
from simulators.plant.kernels import clip, combine, local_forces
from vibrolock.compiled import kernel


@kernel
def sample(rig: Rk4Arrays, state: Rk4State, voltage: float, out: NDArray[np.float64]) -> int:
    """Outputs (SI) into ``out`` [n_channel], then one sample with ``voltage`` (V) held; returns 0."""
    combine(rig.sense, state.inputs, state.outputs)
    for c in range(out.size):
        out[c] = state.outputs[c]
    derivative, sites, elements, stuck = rig.derivative, rig.sites, rig.elements, rig.stuck
    inputs, start, stage, slope, total = state.inputs, state.start, state.stage, state.slope, state.total
    forces, friction, deflection = state.forces, state.friction, state.deflection
    n, h = rig.n_state[0], rig.step_s[0]
    n_local = sites.size
    _, n_jenkins, n_element = elements.shape
    inputs[n] = voltage
    for _ in range(rig.substeps[0]):
        for i in range(start.size):
            stage[i] = start[i]
            total[i] = 0.0
        # Four stages, and a fifth look at the sites to commit what they came to.
        for k in range(5):
            local_forces(sites, stage, n, forces)
            for s in range(n_jenkins):
                z = stage[n + n_local + s]
                dz = z - deflection[s]
                force = stuck[s] * z
                for e in range(n_element):
                    held = clip(friction[s, e] + elements[0, s, e] * dz, elements[1, s, e])
                    if k == 4:
                        friction[s, e] = held
                    force -= held
                forces[n_local + s] = force
                if k == 4:
                    deflection[s] = z
            for s in range(n_local + n_jenkins):
                inputs[n + 1 + s] = forces[s]
            for i in range(n):
                inputs[i] = stage[i]
            if k == 4:
                break
            combine(derivative, inputs, slope)
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
