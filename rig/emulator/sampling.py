"""A device's converters: blocks of samples at their instants, and outputs at theirs."""

import math
from typing import NamedTuple

import numpy as np

from rig.emulator.gate import Gate
from rig.emulator.outputs import OutputQueue
from rig.emulator.plant import Plant
from rig.wire.messages import Output

__all__ = ["Measured", "Sampling"]

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
        """Whether anybody has handed over an output to be let through."""
        self._rate_hz = 1.0
        self._block = self._queue = 1
        self._origin_s = 0.0
        self._gate = Gate()
        self._at_rest = False

    def rest(self) -> None:
        """Bring the plant to rest while there is time: it may take long, and a start has none."""
        if not self._at_rest:
            self.plant.reset()
        self._at_rest = True

    def start(self, rate_hz: float, block: int, queue: int, now_s: float) -> None:
        """Sample 0 is now; no output gets through."""
        self._rate_hz, self._block, self._queue = rate_hz, block, queue
        self._outputs = OutputQueue(block, queue)
        self._gate = Gate()
        self._origin_s = now_s
        self.measured = self.blocks = 0
        self.has_output = False
        self.on = True

    def stop(self) -> None:
        """0 V, and no more samples."""
        self.on = False
        self.output_v = np.zeros(1)
        self.rest()

    @property
    def due_s(self) -> float:
        """When the block that is under way will be measured; never in lockstep."""
        if not self.on or self.lockstep:
            return math.inf
        return self._origin_s + (self.measured + self._block) / self._rate_hz

    def take(self, output: Output, now_s: float) -> int | None:
        """Keep outputs until they are due; how many came in time, None where they make no sense."""
        return self._outputs.put(output.first, output.counts, self._present(now_s))

    def _present(self, now_s: float) -> int:
        """Index of the first sample whose output is not on the converter yet."""
        if self.lockstep:
            return self.measured
        return max(self.measured, math.ceil((now_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES))

    def let_outputs_through(self, now_s: float) -> None:
        """From the present sample on."""
        self._gate.open(self._present(now_s))

    def bring_down(self, at_s: float, ramp_s: float) -> None:
        """Let the output go to 0 V from an instant on, and block what comes."""
        instant = float(self.measured)
        if not self.lockstep:
            instant = max(0.0, (at_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES)
        self._gate.close(instant, ramp_s * self._rate_hz)

    def stand_still(self, now_s: float) -> float:
        """Where nobody let us run for half the queue, our clock stood still: the host waits for the block that is late.

        Half of the queue is then left to it at the least. Returns for how long, s.
        """
        late_s = now_s - self.due_s
        if late_s <= 0.5 * self._queue * self._block / self._rate_hz:
            return 0.0
        self._origin_s += late_s
        return late_s

    def is_due(self, now_s: float) -> bool:
        """Whether a block can be measured: by the clock, or in lockstep where its outputs are there or not needed."""
        if not self.lockstep:
            return self.due_s <= now_s
        if not self.on:
            return False
        block = self._block
        if self.measured < self._queue * block or self._outputs.is_there(self.measured):
            return True
        return self._gate.is_closing(self.measured - block)  # it goes down by itself, and one block beyond

    def measure(self) -> Measured:
        """Put out and measure the next block."""
        first, block = self.measured, self._block
        counts, held = self._outputs.take(first)
        volts = self._gate.let_through(first, counts * self.plant.output_v_per_count)
        self._at_rest = False
        readings, seen = self.plant.step(volts)
        self.output_v = volts
        self.measured = first + block
        self.blocks += 1
        return Measured(first, readings, seen, held and self.has_output and first >= self._queue * block)
