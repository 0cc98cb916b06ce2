"""Compiled loops around the virtual rig: one block behind the DAQ contract, tick and rig fused, and the loopback channels."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.daq import Channel
from rig.tick.kernels import tick
from rig.tick.layout import DEVICE_SHIFT, TickArrays
from rig.tick.safety.kernels import is_over
from simulators.kernels import sample
from simulators.layout import RigArrays, RigState
from vibrolock.compiled import kernel

__all__ = ["Converters", "Loopback", "exchange_block", "fused", "loopback_of"]


class Loopback(NamedTuple):
    """Channels that read the output: the last columns of a row."""

    past: np.ndarray
    """float64[m]: ring of outputs on the converter, V."""
    v_per_v: np.ndarray
    """float64[k]: sensitivity of each channel; k may be 0."""
    whole: int
    """Whole samples by which they read late."""
    part: float
    """The fraction of a sample, linear between two."""


def loopback_of(channels: Sequence[Channel], delay_samples: float) -> Loopback:
    """The loopbacks among ``channels``; ``delay_samples`` is the delay of hold and filters."""
    whole = math.floor(delay_samples)
    v_per_v = np.array([channel.sensitivity_v_per_unit for channel in channels if channel.loopback])
    return Loopback(np.zeros(whole + 2), v_per_v, whole, delay_samples - whole)


class Converters(NamedTuple):
    """What stands between the host and the rig: outputs under way, channels that read the output, counts of flags."""

    queue: np.ndarray
    """float64[d], d may be 0: ring of outputs that are not on the converter yet, V."""
    counts: np.ndarray
    """int64[bits]: samples at which each flag of the rig was up."""
    loopback: Loopback
    """Channels that read the output."""


@kernel
def read_output(loopback: Loopback, index: int, voltage: float, row: np.ndarray) -> None:
    """Note the ``voltage`` that is on the converter at sample ``index``, and fill the loopback columns of its row, V."""
    size, n = loopback.past.size, loopback.v_per_v.size
    loopback.past[index % size] = voltage
    if n > 0:
        seen = (1.0 - loopback.part) * loopback.past[(index - loopback.whole) % size]
        seen += loopback.part * loopback.past[(index - loopback.whole - 1) % size]
        for c in range(n):
            row[row.size - n + c] = seen * loopback.v_per_v[c]


@kernel
def exchange_block(
    rig: RigArrays,
    state: RigState,
    converters: Converters,
    first: int,
    voltages: np.ndarray,
    inputs: np.ndarray,
    flags: np.ndarray,
) -> None:
    """Swap one block with the rig; ``flags`` (uint16[n]) are the rig's for each sample.

    ``first`` is the number of the block's first sample. The queue holds the outputs that the device keeps back.
    """
    queue, loopback = converters.queue, converters.loopback
    delay = queue.size
    sensed = inputs.shape[1] - loopback.v_per_v.size
    for index in range(voltages.size):
        voltage = voltages[index]
        if delay > 0:
            slot = (first + index) % delay
            voltage = queue[slot]
            queue[slot] = voltages[index]
        row = inputs[index]
        read_output(loopback, first + index, voltage, row)
        flags[index] = sample(rig, state, voltage, row[:sensed])
        count_flags(flags[index], converters.counts)


@kernel
def count_flags(flags: int, counts: np.ndarray) -> None:
    """Count every flag that is up."""
    if flags != 0:
        for bit in range(counts.size):
            if flags & (1 << bit):
                counts[bit] += 1


@kernel
def fused(
    t: TickArrays,
    rig: RigArrays,
    state: RigState,
    converters: Converters,
    volts: np.ndarray,
    readings: np.ndarray,
    rows: np.ndarray,
) -> int:
    """Tick and rig in one loop; returns the number of samples done, fewer than ``rows`` once the output is off.

    The queue (float64[d]) holds the outputs under way: what the tick computes at a sample is on the converter d later.
    """
    queue, loopback = converters.queue, converters.loopback
    delay = queue.size
    looped, sensed = loopback.v_per_v.size > 0, volts[: volts.size - loopback.v_per_v.size]
    for index in range(rows.size):
        slot = t.loop[0].sample % delay
        if looped:
            read_output(loopback, t.loop[0].sample, queue[slot], volts)
        flags = sample(rig, state, queue[slot], sensed)
        count_flags(flags, converters.counts)
        queue[slot] = tick(t, volts, False, readings[index], rows[index])
        rows[index].flags |= np.uint32(flags) << np.uint32(DEVICE_SHIFT)
        if is_over(t.guard[0], t.loop[0].lead_whole):
            return index + 1
    return int(rows.size)
