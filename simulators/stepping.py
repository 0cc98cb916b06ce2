"""Compiled virtual rig: one sample of exciter, structure, sensors and converters, and runs of many.

At instant i the sensors are read first; then the state is advanced to instant i + 1 with the voltage held. A voltage therefore
shows in the readings of the next instant: any hold has this latency of one sample. If the converter is oversampled, internal
instants lie between i and i + 1. At each of them the output passes the reconstruction filter and the sensors pass their
filters; only the last one is converted, which decimates the signals.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DIVERGED, RigArrays, RigState
from simulators.plant.kernels import advance
from simulators.products import combine
from simulators.sensing.kernels import condition, convert, delay, filter_output, hold, sense
from vibrolock.compiled import inner_kernel, kernel


@inner_kernel
def sample(rig: RigArrays, state: RigState, voltage: float, out_v: NDArray[np.float64]) -> int:
    """Read every channel into ``out_v`` [n_channel] (V), then hold ``voltage`` (V) until the next instant.

    Returns the `simulators.layout.Flag` bits of this sample. A voltage beyond the converter is clipped, NaN becomes
    0 V; both are flagged. A state that is no longer finite is held, and reads NaN on every channel.
    """
    index = state.counter[0]
    state.counter[0] = index + 1
    converter, values = rig.converter[0], state.outputs
    oversampling = converter.oversampling
    if not sense(rig.sense, state.inputs, values):
        for c in range(out_v.size):
            out_v[c] = math.nan
        return DIVERGED
    flags = read(rig, state, index * oversampling)
    if state.history.shape[0] > 0:
        delay(rig.channels, rig.taps, state.history, index * oversampling, values)
    flags |= convert(rig.channels, converter, rig.noise_keys, index, values, out_v)
    held_v, clipped = hold(converter, rig.noise_keys[0], voltage, index)
    flags |= clipped
    return flags | advance_internally(rig, state, index * oversampling, held_v)


@inner_kernel
def read(rig: RigArrays, state: RigState, instant: int) -> int:
    """Convert sensed values to conditioned, filtered volts and store them for skewed channels; return SENSOR_CLIPPED or 0."""
    flags = condition(rig.conditioning, state.filters, rig.sections, state.memory, state.outputs)
    n_ring = state.history.shape[0]
    if n_ring > 0:
        for c in range(rig.channels.size):
            state.history[instant & (n_ring - 1), c] = state.outputs[c]
    return flags


@inner_kernel
def advance_internally(rig: RigArrays, state: RigState, instant: int, held_v: float) -> int:
    """Advance by one sample over its internal instants, with filters before and after the plant; return the flags."""
    flags = 0
    for m in range(rig.converter[0].oversampling):
        if m > 0:
            sense(rig.sense, state.inputs, state.outputs)
            flags |= read(rig, state, instant + m)
        flags |= advance(rig, state, filter_output(rig.reconstruction, state.output_memory, held_v))
    return flags


@kernel
def run_open_loop(rig: RigArrays, state: RigState, voltages: NDArray[np.float64], out_v: NDArray[np.float64]) -> int:
    """Run one sample per entry of ``voltages`` [n] (V); fill ``out_v`` [n, n_channel] (V) and return all flags, or-ed."""
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
    """Run as `run_open_loop`, and also fill the true quantities ``truth`` [n, padded] and the ``flags`` [n] of each sample.

    ``truth`` is ``observe`` applied to each instant's inputs. ``observe`` [n_input, padded] has the layout of
    ``RigArrays.sense``.
    """
    for k in range(voltages.size):
        combine(observe, state.inputs, truth[k])
        flags[k] = sample(rig, state, voltages[k], out_v[k])
