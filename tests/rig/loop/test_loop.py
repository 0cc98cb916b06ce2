"""The loop in the campaign's own process, over a device with a clock."""

import pytest

from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqError
from rig.loop.loop import Loop
from tests.rig.loop.worker.rigs import slow_bench, tone


class ClockedDAQ(VirtualDAQ):
    """Counts as a device: it wants to be told to stop. Without an answer where ``deaf``."""

    wall_clock = True
    deaf = False
    stopped = 0

    def _stop(self):
        self.stopped += 1
        if self.deaf:
            raise DaqError("no answer to STOP")


@pytest.mark.parametrize("deaf", [False, True])
def test_a_device_is_stopped_before_anybody_gets_the_last_rows(deaf):
    bench = slow_bench("virtual")
    with ClockedDAQ(bench, 1) as daq:
        daq.deaf = deaf
        daq.start(bench.block)
        loop = Loop(daq, tone(bench, 0.1).build(daq.latency_samples), fused=False)
        stopped = [daq.stopped for _ in loop.run()]
    assert (stopped[0], stopped[-1]) == (int(len(stopped) == 1), 1)
    assert (str(loop.failure) == "no answer to STOP") is deaf
