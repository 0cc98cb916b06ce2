"""A device's sampling: outputs kept until they are due, the gate before the converter, and the blocks measured."""

import math
from typing import NamedTuple

import numpy as np

from rig.emulator.plant import Plant
from rig.wire.messages import Output

__all__ = ["Gate", "Measured", "OutputQueue", "Sampling"]


class Gate:
    """Passes outputs to the converter or sets them to 0 V, by sample index; an instant between two samples is a fraction."""

    def __init__(self) -> None:
        self._opens = math.inf
        self._closes = math.inf
        self._ramp_samples = 0.0

    def open(self, first: int) -> None:
        """Pass outputs from sample ``first`` on."""
        self._opens, self._closes = first, math.inf

    def close(self, instant: float, ramp_samples: float = 0.0) -> None:
        """Bring the output to 0 V by a ramp of ``ramp_samples`` that begins at an instant."""
        self._closes, self._ramp_samples = instant, ramp_samples

    def is_closing(self, first: int) -> bool:
        """Whether the gate was closed and its ramp may still be under way at sample ``first``."""
        return first < self._closes + self._ramp_samples and self._closes < math.inf

    def let_through(self, first: int, volts: np.ndarray) -> np.ndarray:
        """Return the outputs [n] of a block as they reach the converter."""
        if first < self._opens:
            volts[: int(min(volts.size, self._opens - first))] = 0.0
        if first + volts.size > self._closes:
            beyond = np.arange(first, first + volts.size) - self._closes
            if self._ramp_samples == 0.0:
                volts[beyond >= 0.0] = 0.0
            else:
                volts *= np.clip(1.0 - beyond / self._ramp_samples, 0.0, 1.0)
        return volts


BLOCKS_AHEAD = 4  # blocks beyond the queue by which a host may be early


class OutputQueue:
    """A ring of outputs by the index of the sample at which they are due, ``block`` samples per slot."""

    def __init__(self, block: int, queue: int) -> None:
        self.block = block
        self._size = (queue + BLOCKS_AHEAD) * block
        self._values = np.zeros(self._size)
        self._there = np.zeros(self._size, bool)
        self.held = 0.0
        """Count that the converter holds."""

    def put(self, first: int, counts: np.ndarray, present: int) -> int | None:
        """Keep the outputs of a block; those due before sample ``present`` are too late.

        Returns how many are in time; None for a block of the wrong size or place.
        """
        block = self.block
        if counts.shape != (block,) or first < 0 or first % block:
            return None
        if first + block > present - present % block + self._size:
            return None
        late = min(max(0, present - first), block)
        slot = first % self._size
        self._values[slot + late : slot + block] = counts[late:]
        self._there[slot + late : slot + block] = True
        return block - late

    def is_there(self, first: int) -> bool:
        """Whether all outputs of the block at ``first`` have arrived."""
        slot = first % self._size
        return bool(self._there[slot : slot + self.block].all())

    def take(self, first: int) -> tuple[np.ndarray, bool]:
        """Counts of a block for the converter, and whether a missing one was replaced by the last; frees the slot."""
        slot = slice(first % self._size, first % self._size + self.block)
        values, there = self._values[slot].copy(), self._there[slot]
        held = not there.all()
        if held:
            last = self.held
            for index in range(self.block):
                last = values[index] = values[index] if there[index] else last
        self._there[slot] = False
        self.held = float(values[-1])
        return values, held


ROUNDING_SAMPLES = 1e-6  # an instant that falls on a sample is that sample's


class Measured(NamedTuple):
    """A block that has been measured."""

    first: int
    readings: np.ndarray
    """Counts [n, n_channels]."""
    seen: int
    """`DeviceFlag` bits of the converters."""
    held: bool
    """Whether an output was missing that should have come."""


class Sampling:
    """The plant, sampled block by block since `start`.

    Instants are seconds of the clock that the device is run by; with ``lockstep`` there are none, and a block is measured
    once its outputs have come.
    """

    def __init__(self, plant: Plant, *, lockstep: bool) -> None:
        self.plant, self.lockstep = plant, lockstep
        self.on = False
        self.measured = 0
        """Samples measured since the start."""
        self.blocks = 0
        """Blocks measured since the start."""
        self.output_v = np.zeros(0)
        """Output of the block that was measured last, V."""
        self.has_output = False
        """Whether an output has arrived since the device was armed."""
        self._rate_hz = 1.0
        self._block = self._queue = 1
        self._origin_s = 0.0
        self._gate = Gate()
        self._at_rest = False

    def rest(self) -> None:
        """Bring the plant to rest; done at a stop because it may take longer than a start may."""
        if not self._at_rest:
            self.plant.reset()
        self._at_rest = True

    def start(self, rate_hz: float, block: int, queue: int, now_s: float) -> None:
        """Begin with sample 0 now, with the gate closed."""
        self._rate_hz, self._block, self._queue = rate_hz, block, queue
        self._outputs = OutputQueue(block, queue)
        self._gate = Gate()
        self._origin_s = now_s
        self.measured = self.blocks = 0
        self.has_output = False
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
        return self._outputs.put(output.first, output.counts, self._present(now_s))

    def _present(self, now_s: float) -> int:
        """Index of the first sample whose output is not on the converter yet."""
        if self.lockstep:
            return self.measured
        return max(self.measured, math.ceil((now_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES))

    def let_outputs_through(self, now_s: float) -> None:
        """Open the gate from the present sample on."""
        self._gate.open(self._present(now_s))

    def bring_down(self, at_s: float, ramp_s: float) -> None:
        """Bring the output to 0 V from an instant on, by a ramp, and ignore further outputs."""
        instant = float(self.measured)
        if not self.lockstep:
            instant = max(0.0, (at_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES)
        self._gate.close(instant, ramp_s * self._rate_hz)

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
        return self._gate.is_closing(
            self.measured - block
        )  # during a ramp to 0 V no outputs are needed, nor for one block after it

    def measure(self) -> Measured:
        """Put out the next block of outputs and measure it."""
        first, block = self.measured, self._block
        counts, held = self._outputs.take(first)
        volts = self._gate.let_through(first, counts * self.plant.output_v_per_count)
        self._at_rest = False
        readings, seen = self.plant.step(volts)
        self.output_v = volts
        self.measured = first + block
        self.blocks += 1
        return Measured(first, readings, seen, held and self.has_output and first >= self._queue * block)
