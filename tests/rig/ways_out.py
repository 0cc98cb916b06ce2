"""A virtual rig that writes down what it is handed, and is faulty at one block or some."""

import numpy as np

from rig.drivers.virtual import VirtualDAQ

FAULT_BLOCK = 40


class TelltaleDAQ(VirtualDAQ):
    """``handed``: every block of outputs, in order, and None at each stop.

    ``fault(inputs)`` changes the readings (V) of a block, or raises once it is swapped; ``raises`` is raised before.
    """

    wall_clock = True
    run_fused = None

    def __init__(self, bench, seed=0, fault=None, raises=None, times=1):
        super().__init__(bench, seed)
        self.handed = []
        self.fault, self.raises, self.times = fault, raises, times
        self.calls = 0

    @property
    def capabilities(self):
        """A device that waits for the host: no clock of a busy machine has a part in what is tested."""
        return super().capabilities.model_copy(update={"paced": True})

    def _exchange(self, voltages, inputs):
        self.calls += 1
        at_fault = FAULT_BLOCK <= self.calls < FAULT_BLOCK + self.times
        if at_fault and self.raises is not None:
            raise self.raises
        self.handed.append(voltages.copy())
        super()._exchange(voltages, inputs)
        if at_fault and self.fault is not None:
            self.fault(inputs)

    def _stop(self):
        self.handed.append(None)
        super()._stop()

    @property
    def outputs(self):
        """All outputs that were handed over, V, before the first stop."""
        return np.concatenate(self.blocks)

    @property
    def blocks(self):
        """Blocks that were handed over before the first stop."""
        return self.handed[: next(number for number, block in enumerate(self.handed) if block is None)]

    @property
    def zeros_at_the_end(self):
        """Number of blocks of 0 V right before the first stop."""
        driven = [number for number, block in enumerate(self.blocks) if block.any()]
        return len(self.blocks) - 1 - driven[-1]


def beyond_all_limits(inputs):
    """A drive reading that drops the output at once."""
    inputs[:, 1] = 1e30
