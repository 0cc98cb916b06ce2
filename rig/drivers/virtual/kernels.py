"""Compiled loops around the virtual rig: one block behind the DAQ contract, tick and rig fused, and the loopback channels."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from rig.daq import LOST, Channel
from rig.drivers.virtual.faults import FaultArrays, convert
from rig.tick.kernels import note_faults, note_put_out, tell_continuation, tick
from rig.tick.layout import DEVICE_SHIFT, TickArrays
from rig.tick.safety.kernels import is_over
from simulators.kernels import RigArrays, RigState, addressed, rig_at, sample, state_at
from vibrolock.compiled import bound, inner_kernel, kernel


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
    """int64[bits + 1]: samples at which each flag was up, then samples lost."""
    loopback: Loopback
    """Channels that read the output."""
    faults: FaultArrays
    """Passing faults of the device."""
    releases: bool
    """Whether the rig is another while the output is exactly 0 V."""
    released: np.ndarray
    """That other rig, by the addresses of its arrays (`simulators.kernels.addressed`)."""


@kernel
def sample_released(released: np.ndarray, state: RigState, voltage: float, row: np.ndarray) -> int:
    """Advance the released rig by one sample; not inlined, which would double the machine code of the loops."""
    return int(sample(rig_at(released), state, voltage, row))


@inner_kernel
def sampled(rig: RigArrays, state: RigState, converters: Converters, voltage: float, row: np.ndarray) -> int:
    """Advance the rig by one sample: the released one while the output is 0 V, if it is to be released."""
    if converters.releases and voltage == 0.0:
        return int(sample_released(converters.released, state, voltage, row))
    return int(sample(rig, state, voltage, row))


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
    rig_places: np.ndarray,
    state_places: np.ndarray,
    converters: Converters,
    first: int,
    voltages: np.ndarray,
    inputs: np.ndarray,
    flags: np.ndarray,
    put_out: np.ndarray,
) -> None:
    """Swap one block with the rig; ``flags`` (uint16[n]) are the rig's for each sample.

    Rig and state are given by the addresses of their arrays (`simulators.kernels.addressed`). ``first`` is the number of the
    block's first sample. The queue holds the outputs that the device keeps back. ``put_out``
    (float64[n], V) is what the converter has put out in place of an output, else NaN.
    """
    rig, state = rig_at(rig_places), state_at(state_places)
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
        voltage, raised = convert(converters.faults, first + index, voltage)
        put_out[index] = voltage if raised & ~LOST else math.nan
        read_output(loopback, first + index, voltage, row)
        flags[index] = told(sampled(rig, state, converters, voltage, row[:sensed]) | raised, converters.counts)
        if flags[index] & LOST:
            row[:] = math.nan


class Exchange:
    """Swaps blocks with a rig, in one compiled call each whose arguments are prepared once."""

    def __init__(self, rig: RigArrays, state: RigState, converters: Converters) -> None:
        self._rig, self._kept = addressed(rig), (rig, state)
        self._state, self._converters = addressed(state), converters
        self._call: Callable[..., None] | None = None

    def change(self, rig: RigArrays) -> None:
        """Go on with other arrays of the rig, of the same sizes."""
        if rig is not self._kept[0]:
            self._rig[:], self._kept = addressed(rig), (rig, self._kept[1])

    def __call__(
        self, first: int, voltages: np.ndarray, inputs: np.ndarray, flags: np.ndarray, put_out: np.ndarray
    ) -> None:
        """Swap a block: arguments of `exchange_block`, all of them contiguous."""
        if self._call is None:
            held = self._rig, self._state, self._converters
            self._call = partial(bound(exchange_block, *held, first, voltages, inputs, flags, put_out), *held)
        self._call(first, voltages, inputs, flags, put_out)


@kernel
def told(flags: int, counts: np.ndarray) -> int:
    """Count every flag that is up and return the flags as the host sees them: with a lost sample, its flags are lost too."""
    if flags == 0:
        return 0
    if flags & LOST:
        counts[counts.size - 1] += 1
        return LOST
    for bit in range(counts.size - 1):
        if flags & (1 << bit):
            counts[bit] += 1
    return flags


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
    queue, loopback, outputs = converters.queue, converters.loopback, converters.faults.outputs
    delay = queue.size
    looped, sensed = loopback.v_per_v.size > 0, volts[: volts.size - loopback.v_per_v.size]
    for index in range(rows.size):
        slot = t.loop[0].sample % delay
        voltage, raised = convert(converters.faults, t.loop[0].sample, queue[slot])
        if looped:
            read_output(loopback, t.loop[0].sample, voltage, volts)
        flags = told(sampled(rig, state, converters, voltage, sensed) | raised, converters.counts)
        note_faults(t, flags)
        if raised & ~LOST:
            note_put_out(t, voltage)
        queue[slot] = tick(t, volts, (flags & LOST) != 0, readings[index], rows[index])
        rows[index].flags |= np.uint32(flags) << np.uint32(DEVICE_SHIFT)
        if converters.faults.any and t.loop[0].sample % outputs.block == 0:
            tell_continuation(t, outputs.told)
        if is_over(t.guard[0], t.loop[0].delay_whole):
            return index + 1
    return int(rows.size)
