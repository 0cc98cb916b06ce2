"""The plant's integrator alone, in one compiled loop."""

import numpy as np
from numpy.typing import NDArray

from simulators.kernels import RigArrays, RigState, advance
from vibrolock.compiled import kernel


@kernel
def run(rig: RigArrays, state: RigState, voltages: NDArray[np.float64], internal: int) -> int:
    """``internal`` calls of `advance` per voltage; returns all flags, or-ed."""
    flags = 0
    for k in range(voltages.size):
        for _ in range(internal):
            flags |= advance(rig, state, voltages[k])
    return flags
