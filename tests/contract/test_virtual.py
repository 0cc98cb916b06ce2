"""The virtual driver under the contract, with and without latency, and that the contract catches a bad driver."""

import numpy as np
import pytest

from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers import make_daq
from tests.rig.rigs import bench_with


class TestVirtualRig(DriverContract):
    def make(self) -> DAQ:
        return make_daq(bench_with())


class TestSymmetricRig(DriverContract):
    def make(self) -> DAQ:
        return make_daq(bench_with(name="magnet-beam-symmetric"))


class TestVirtualRigWithDelay(DriverContract):
    def make(self) -> DAQ:
        return make_daq(bench_with(delay_samples=3))


class TestVirtualRigWithQueue(DriverContract):
    def make(self) -> DAQ:
        return make_daq(bench_with(queue_blocks=2))


def _broken(cls, **overrides):
    """The contract over a virtual driver with methods replaced."""

    class Broken(cls):
        def make(self):
            daq = make_daq(bench_with())
            for name, method in overrides.items():
                setattr(daq, name, method.__get__(daq))
            return daq

    return Broken()


def _swallow(self, voltages, inputs):
    inputs[:] = np.nan


def _drive_early(self, voltages, inputs):
    inputs[:] = voltages[-1]


def _forget_to_close(self):
    raise RuntimeError("cannot close twice")


@pytest.mark.parametrize(
    ("override", "test"),
    [
        ({"_exchange": _swallow}, "test_every_call_returns_one_row_a_sample_and_one_column_a_channel"),
        ({"_exchange": _drive_early}, "test_every_block_size_gives_the_same_samples"),
        ({"start": lambda self, block=1: None}, "test_the_life_cycle_is_open_start_stop_close"),
        (
            {"exchange": lambda self, v: np.zeros((self.block, 4))},
            "test_voltages_beyond_the_range_or_not_a_number_are_refused",
        ),
        ({"_close": _forget_to_close}, "test_close_may_be_called_at_any_time_and_again"),
    ],
)
def test_the_contract_catches_a_driver_that_breaks_it(override, test):
    contract = _broken(DriverContract, **override)
    with pytest.raises((AssertionError, RuntimeError)):
        getattr(contract, test)()
