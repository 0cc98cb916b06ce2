"""A device's sampling: instants, the outputs put out at them, and the blocks measured."""

import math
from typing import NamedTuple

import numpy as np

from rig.emulator.outputs import Converter, OutputQueue
from rig.emulator.plant import VirtualPlant
from rig.wire.messages import DeviceFlag, Output

HELD, CONTINUED = int(DeviceFlag.OUTPUT_HELD), int(DeviceFlag.OUTPUT_CONTINUED)
ROUNDING_SAMPLES = 1e-6  # an instant that falls on a sample is that sample's


class Measured(NamedTuple):
    """A block that has been measured."""

    first: int
    readings: np.ndarray
    """Counts [n, n_channels]."""
    flags: int
    """`DeviceFlag` bits of the converters, and of outputs that had not come."""
    put_out: np.ndarray
    """Counts [n] that the output converter has put out, int64."""


class Sampling:
    """The plant, sampled block by block since `start`.

    Instants are seconds of the clock that the device is run by; with ``lockstep`` there are none, and a block is measured
    once its outputs have come.
    """

    def __init__(self, plant: VirtualPlant, *, lockstep: bool) -> None:
        self.plant, self.lockstep = plant, lockstep
        self.on = False
        self.measured = 0
        """Samples measured since the start."""
        self.blocks = 0
        """Blocks measured since the start."""
        self.output_v = np.zeros(0)
        """Output of the block that was measured last, V."""
        self._has_output = False
        self._rate_hz = 1.0
        self._block = self._queue = 1
        self._origin_s = 0.0
        self._put_out = 0
        self._missing = 0
        self._converter = Converter(plant.output_range_v)
        self._at_rest = False

    def rest(self) -> None:
        """Bring the plant to rest; done at a stop because it may take longer than a start may."""
        if not self._at_rest:
            self.plant.reset()
        self._at_rest = True

    def start(self, rate_hz: float, block: int, queue: int, longest_period: int, now_s: float) -> None:
        """Begin with sample 0 now, at 0 V."""
        self._rate_hz, self._block, self._queue = rate_hz, block, queue
        self._outputs = OutputQueue(block, queue, longest_period)
        self._converter = Converter(self.plant.output_range_v)
        self._volts = np.zeros(block)
        self._origin_s = now_s
        self.measured = self.blocks = self._put_out = 0
        self._has_output, self._missing = False, 0
        self.on = True

    def stop(self) -> None:
        """Set the output to 0 V and take no more samples."""
        self.on = False
        self.output_v = np.zeros(1)
        self.rest()

    @property
    def due_s(self) -> float:
        """When the current block will be complete; never in lockstep."""
        if not self.on or self.lockstep:
            return math.inf
        return self._origin_s + (self.measured + self._block) / self._rate_hz

    def take(self, output: Output, now_s: float) -> int | None:
        """Keep outputs until they are due; how many are in time, None for a malformed block."""
        present = self._present(now_s)
        self._put_out_before(present)  # which frees their places for outputs that are due later
        in_time = self._outputs.put(output, present)
        self._has_output |= in_time is not None
        return in_time

    def _present(self, now_s: float) -> int:
        """Index of the first sample whose output is not on the converter yet."""
        if self.lockstep:
            return self.measured
        return max(self.measured, math.ceil((now_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES))

    def let_outputs_through(self, now_s: float) -> None:
        """Pass outputs from the present sample on."""
        if self.on:
            present = self._present(now_s)
            self._put_out_before(present)
            self._outputs.forget(present)
        self._converter.open()

    def bring_down(self, at_s: float, ramp_s: float) -> None:
        """Bring the output to 0 V from an instant on, by a ramp, and ignore further outputs."""
        instant = float(self.measured)
        if not self.lockstep:
            instant = max(0.0, (at_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES)
        if self.on:
            self._put_out_before(math.ceil(instant))
        self._converter.close(instant, ramp_s * self._rate_hz)

    @property
    def is_ramping(self) -> bool:
        """Whether the output is on its way to 0 V."""
        return self.on and self._converter.is_closing(self._put_out)

    def _put_out_before(self, end: int) -> None:
        """Put out the samples of the block under way that are due before sample ``end``."""
        begun, block_first = self._put_out, self.measured
        end = min(end, block_first + self._block)
        if end <= begun:
            return
        due = self._outputs.take(begun, end)
        volts = due.counts * self.plant.output_v_per_count
        volts = self._converter.put_out(begun, volts, due.there)
        self._volts[begun - block_first : end - block_first] = volts
        if self._converter.is_open and self._has_output and block_first >= self._queue * self._block:
            self._missing |= 0 if due.is_whole else HELD
            self._missing |= CONTINUED if due.is_continued else 0
        self._put_out = end

    def stand_still(self, now_s: float) -> float:
        """If this process was not scheduled for more than half the queue, stop the device clock for that time.

        The host then still has at least half the queue to answer. Returns for how long the clock stood still, s.
        """
        late_s = now_s - self.due_s
        if late_s <= 0.5 * self._queue * self._block / self._rate_hz:
            return 0.0
        self._origin_s += late_s
        return late_s

    def is_due(self, now_s: float) -> bool:
        """Whether a block can be measured: by the clock, or in lockstep if its outputs have arrived or are not needed."""
        if not self.lockstep:
            return self.due_s <= now_s
        if not self.on:
            return False
        block = self._block
        if self.measured < self._queue * block or self._outputs.is_there(self.measured):
            return True
        # during a ramp to 0 V no outputs are needed, nor for one block after it
        return self._converter.is_closing(self.measured - block)

    def measure(self) -> Measured:
        """Put out the rest of the block under way, and measure it."""
        first, block = self.measured, self._block
        self._put_out_before(first + block)
        volts, missing = self._volts, self._missing
        self._volts, self._missing = np.zeros(block), 0
        self._at_rest = False
        readings, seen = self.plant.step(volts)
        self.output_v = volts
        self.measured = first + block
        self.blocks += 1
        instead = getattr(self.plant, "put_out", None)  # what the plant's own faults have put out instead
        put_out = volts if instead is None else np.where(np.isfinite(instead), instead, volts)
        return Measured(first, readings, seen | missing, self._counts_of(put_out))

    def _counts_of(self, volts: np.ndarray) -> np.ndarray:
        """What the converter makes of voltages: the nearest counts within its range."""
        step_v, most = self.plant.output_v_per_count, 2 ** (self.plant.bits - 1) - 1
        largest = round(self.plant.output_range_v / step_v)
        counts = np.maximum(np.rint(volts / step_v), -min(largest, most + 1))  # both in a third of the time of np.clip
        return np.asarray(np.minimum(counts, min(largest, most)), np.int64)
