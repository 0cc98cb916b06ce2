"""The box under the contract, and what the contract cannot know of it."""

from pathlib import Path

from vibrolock_box import BoxDAQ

from rig.bench import Bench, load_bench
from rig.conformance import DriverContract
from rig.daq import DAQ

BENCH = Path(__file__).parents[1] / "box-bench.toml"


class TestBox(DriverContract):
    """Nothing is driven at more than ``amplitude_v``."""

    amplitude_v = 0.05
    tolerance_v = 0.02

    def make(self) -> BoxDAQ:
        """A box that is not open."""
        return BoxDAQ(load_bench(BENCH))

    def witness(self, daq: DAQ | None) -> float | None:
        """What is on the stand-in's output, also once the driver has let go; with a real box, what a meter reads there."""
        if isinstance(daq, BoxDAQ) and daq.device is not None:
            self._seen = daq.device
        return None if daq is None else abs(self._seen.output_v)

    def bench_for_another_process(self) -> Bench:
        """The bench, to compare the driver with."""
        return load_bench(BENCH)

    def unplug(self, daq: DAQ) -> bool:
        """Pull the stand-in's cable."""
        assert isinstance(daq, BoxDAQ)
        assert daq.device is not None
        daq.device.plugged = False
        return True
