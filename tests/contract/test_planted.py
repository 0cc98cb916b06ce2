"""Every planted fault is failed by the kit, in the test that names it; the good drivers that it is planted in are not."""

import time

import numpy as np
import pytest

from rig.conformance import DriverContract, NotApplicable, Unproven, with_loopback
from tests.contract.planted import PLANTED
from tests.contract.planted.drivers import GOOD, PacedDAQ, UnseenDAQ
from tests.rig.rigs import bench_with

BENCH = bench_with()
TESTS = sorted(name.removeprefix("test_") for name in dir(DriverContract) if name.startswith("test_"))


class Punctual:
    """A host that is never late, or always."""

    late = False

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def was_late(self, began_s, ended_s):
        return self.late


class OverADriver(DriverContract):
    """The contract over a driver in simulated time."""

    long_run_blocks = 2200
    message_s = 0.1
    prompt_s = 0.5

    def __init__(self, driver, host=Punctual):
        self.driver, self.host = driver, host

    def make(self):
        return self.driver(BENCH)

    def make_loopback(self):
        return self.driver(with_loopback(BENCH))

    def bench_for_another_process(self):
        return BENCH

    def known_inputs(self, outputs, block):
        good = next(driver for driver in self.driver.__mro__ if driver in GOOD)
        with good(BENCH) as daq:
            daq.start(block)
            return np.vstack([daq.exchange(part.copy()) for part in outputs.reshape(-1, block)])

    def now_s(self, daq):
        return getattr(daq, "now_s", time.perf_counter())

    def pause(self, daq, seconds):
        daq.now_s += seconds

    def unplug(self, daq):
        daq.plugged = False
        return hasattr(type(daq), "plugged")

    def skip(self, reason):
        raise NotApplicable(reason)

    def unproven(self, reason):
        raise Unproven(reason)


def found(contract, test):
    """What a test says: the objection, or nothing; `NotApplicable` goes through."""
    try:
        getattr(contract, f"test_{test}")()
    except NotApplicable:
        raise
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""
