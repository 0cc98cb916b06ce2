"""The box under the contract, and what the contract cannot know of it."""

from pathlib import Path

from vibrolock_box import BoxDAQ

from rig.bench import load_bench
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
        """What is on the stand-in's output; with a real box, what a meter reads there."""
        return abs(daq.device.output_v) if isinstance(daq, BoxDAQ) and daq.device is not None else None

    def unplug(self, daq: DAQ) -> bool:
        """Pull the stand-in's cable."""
        assert isinstance(daq, BoxDAQ)
        assert daq.device is not None
        daq.device.plugged = False
        return True
