"""The virtual driver under the contract, with and without latency, and that the contract catches a bad driver."""

import numpy as np
import pytest

from rig.conformance import DriverContract, with_loopback
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqError
from tests.rig.rigs import bench_with


class VirtualContract(DriverContract):
    """The contract over a virtual bench, and over the same with a loopback."""

    bench = bench_with()

    def make(self) -> DAQ:
        return make_daq(self.bench)

    def make_loopback(self) -> DAQ:
        return make_daq(with_loopback(self.bench))


class TestVirtualRig(VirtualContract):
    pass


class TestSymmetricRig(VirtualContract):
    bench = bench_with(name="magnet-beam-symmetric")


class TestVirtualRigWithDelay(VirtualContract):
    bench = bench_with(delay_samples=3)


class TestVirtualRigWithQueue(VirtualContract):
    bench = bench_with(queue_blocks=2)


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


class Boastful(VirtualDAQ):
    """Claims to be later than it is, and, where it says so, that its filters make a part of that."""

    filters = 0.0

    @property
    def latency_samples(self):
        return 8.5

    @property
    def filter_delay_samples(self):
        return self.filters


@pytest.mark.parametrize("filters", [0.0, 5.0])
def test_the_contract_catches_an_output_that_shows_before_its_latency(filters):
    class Contract(DriverContract):
        def make(self):
            daq = Boastful(bench_with())
            daq.filters = filters
            return daq

    with pytest.raises(AssertionError):
        Contract().test_an_output_does_not_show_before_its_latency()


def test_the_contract_catches_filters_that_are_later_than_the_whole_device():
    class Contract(DriverContract):
        def make(self):
            daq = Boastful(bench_with())
            daq.filters = 9.0
            return daq

    with pytest.raises(AssertionError):
        Contract().test_the_latency_is_known_and_not_negative()


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
    with pytest.raises((AssertionError, DaqError)):
        getattr(contract, test)()
