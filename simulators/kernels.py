"""Compiled virtual rig: one sample of exciter, structure, sensors and converters, and runs of many.

Within instant i the sensors are read first, then the state is advanced to instant i + 1 with the voltage held. A
voltage therefore shows in the readings of the next instant: the one sample of latency that any hold has.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DAC_CLIPPED, DIVERGED, RigArrays, RigState
from simulators.plant.kernels import advance, combine
from simulators.sensing.kernels import measure, quantise
from vibrolock.compiled import kernel


@kernel
def sample(rig: RigArrays, state: RigState, voltage: float, out_v: NDArray[np.float64]) -> int:
    """Read every channel into ``out_v`` [n_channel] (V), then hold ``voltage`` (V) until the next instant.

    Returns the `simulators.layout.Flag` bits of this sample. A voltage beyond the converter is clipped, NaN becomes
    0 V; both are flagged. A state that is no longer finite is held, and reads NaN on every channel.
    """
    combine(rig.sense, state.inputs, state.outputs)
    index = state.counter[0]
    state.counter[0] = index + 1
    flags = measure(rig.channels, rig.converter, rig.noise_keys, state.filters, state.outputs, index, out_v)
    if flags & DIVERGED:
        return flags
    converter = rig.converter[0]
    if not abs(voltage) <= converter.dac_range_v:
        flags |= DAC_CLIPPED
    held_v = 0.0 if math.isnan(voltage) else quantise(voltage, converter.dac_step_v, converter.dac_range_v)
    return flags | advance(rig, state, held_v)


@kernel
def run_open_loop(rig: RigArrays, state: RigState, voltages: NDArray[np.float64], out_v: NDArray[np.float64]) -> int:
    """One sample per voltage: ``voltages`` [n] (V) in, ``out_v`` [n, n_channel] (V) out; returns all flags, or-ed."""
    flags = 0
    for k in range(voltages.size):
        flags |= sample(rig, state, voltages[k], out_v[k])
    return flags


@kernel
def run_observed(
    rig: RigArrays,
    state: RigState,
    observe: NDArray[np.float64],
    voltages: NDArray[np.float64],
    out_v: NDArray[np.float64],
    truth: NDArray[np.float64],
    flags: NDArray[np.int64],
) -> None:
    """As `run_open_loop`, and what no sensor shows: ``truth`` [n, padded] = ``observe`` applied to each instant's inputs.

    ``observe`` [n_input, padded] is laid out as ``RigArrays.sense``; ``flags`` [n] are those of each sample.
    """
    for k in range(voltages.size):
        combine(observe, state.inputs, truth[k])
        flags[k] = sample(rig, state, voltages[k], out_v[k])
