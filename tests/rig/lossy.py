"""A virtual device that loses samples on their way, as a wire does."""

from collections.abc import Iterable

import numpy as np

from rig.bench import Bench
from rig.daq import LOST
from rig.drivers.virtual import VirtualDAQ


class LossyDAQ(VirtualDAQ):
    """Loses the instants of ``gaps`` (first, end); goes through `DAQ.exchange` as a real device does."""

    run_fused = None
    gaps: tuple[tuple[int, int], ...] = ()

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        first = self._first
        super()._exchange(voltages, inputs)
        instants = np.arange(first, first + voltages.size)
        for begin, end in self.gaps:
            lost = (instants >= begin) & (instants < end)
            inputs[lost] = np.nan
            self.flags[lost] = LOST


def lose(monkeypatch, gaps: Iterable[tuple[int, int]]) -> None:
    """Let every session of this test have a device that loses the instants of these gaps."""

    def make(bench: Bench, seed: int = 0) -> LossyDAQ:
        daq = LossyDAQ(bench, seed)
        daq.gaps = tuple(gaps)
        return daq

    monkeypatch.setattr("rig.session.make_daq", make)
