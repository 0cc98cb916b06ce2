"""A virtual device that loses samples on their way, as a wire does."""

from collections.abc import Sequence

import numpy as np

from rig.bench import Bench
from rig.daq import LOST
from rig.drivers.virtual import VirtualDAQ


class LossyDAQ(VirtualDAQ):
    """Loses the instants of ``gaps`` (first, end); goes through `DAQ.exchange` as a real device does."""

    run_fused = None
    lost = np.zeros(0, bool)
    """Whether an instant is lost; none beyond its end."""

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        first = self._first
        super()._exchange(voltages, inputs)
        lost = np.flatnonzero(self.lost[first : first + voltages.size])
        inputs[lost] = np.nan
        self.flags[lost] = LOST


def lose(monkeypatch, gaps: Sequence[tuple[int, int]]) -> None:
    """Let every session of this test have a device that loses the instants of these gaps."""

    lost = np.zeros(max((end for _, end in gaps), default=0), bool)
    for first, end in gaps:
        lost[first:end] = True

    def make(bench: Bench, seed: int = 0) -> LossyDAQ:
        daq = LossyDAQ(bench, seed)
        daq.lost = lost
        return daq

    monkeypatch.setattr("rig.loop.session.make_daq", make)
