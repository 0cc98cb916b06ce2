"""Every planted fault is failed by the kit, in the test that names it; the good drivers that it is planted in are not."""

import numpy as np
import pytest

from rig.conformance import DriverContract, NotApplicable, Unproven, with_loopback
from rig.drivers.virtual import VirtualDAQ
from tests.contract.planted import PLANTED
from tests.contract.planted.continuing import ContinuingDAQ
from tests.contract.planted.drivers import GOOD, CloseUnseen, LateHost, PacedDAQ, StopUnseen
from tests.contract.planted.hosts import Late, LateUnseen, Punctual
from tests.contract.planted.table import BEGIN, written
from tests.docs.pages import ROOT
from tests.refused import refused
from tests.rig.rigs import bench_with

BENCH = bench_with()
TESTS = sorted(name.removeprefix("test_") for name in dir(DriverContract) if name.startswith("test_"))


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
        with VirtualDAQ(BENCH) as daq:
            daq.start(block)
            return np.vstack([daq.exchange(part.copy()) for part in outputs.reshape(-1, block)])

    def now_s(self, daq):
        return getattr(daq, "now_s", 0.0)

    def pause(self, daq, seconds):
        daq.now_s += seconds

    def unplug(self, daq):
        daq.plugged = False
        return hasattr(type(daq), "plugged")

    def skip(self, reason):
        raise NotApplicable(reason)

    def unproven(self, reason):
        raise Unproven(reason)


def objection(contract, test):
    """What a test of the kit objects to; nothing if it passes, or does not apply."""
    try:
        getattr(contract, f"test_{test}")()
    except Unproven:
        raise
    except NotApplicable:
        return ""
    except Exception as error:  # a driver may fail in any way
        return f"{type(error).__name__}: {error}"
    return ""


def objection_or_doubt(contract, test):
    """The same, with ``unproven`` for what could not be judged."""
    try:
        return objection(contract, test)
    except Unproven:
        return "unproven"


@pytest.mark.parametrize("fault", PLANTED, ids=lambda fault: fault.driver.__name__)
def test_the_kit_fails_a_planted_fault_in_the_test_that_names_it(fault):
    said = objection(OverADriver(fault.driver), fault.test)
    assert said.partition(": ")[2], "passed, or failed without a message"


@pytest.mark.parametrize("driver", [*GOOD, ContinuingDAQ], ids=lambda driver: driver.__name__)
def test_a_good_driver_is_failed_by_no_test(driver):
    said = {test: objection_or_doubt(OverADriver(driver), test) for test in TESTS}
    assert {test: text for test, text in said.items() if text not in ("", "unproven")} == {}


def test_every_test_of_the_kit_is_there_for_a_planted_fault():
    assert set(TESTS) - {fault.test for fault in PLANTED} == {"the_output_comes_to_0_v_without_the_host"}


@pytest.mark.parametrize(("driver", "way"), [(StopUnseen, "stop"), (CloseUnseen, "close")])
def test_what_nobody_can_see_is_unproven_and_not_passed(driver, way):
    with refused(Unproven, "voltmeter-second-daq"):
        objection(OverADriver(driver), f"{way}_alone_brings_the_output_to_0_v")


def test_without_any_loopback_the_kit_says_what_a_cable_would_prove():
    contract = OverADriver(PacedDAQ)
    contract.make_loopback = lambda: None
    for test in ("every_output_shows_in_the_loopback_once_and_in_its_order", "the_latency_is_that_of_the_loopback"):
        with refused(Unproven, "by-a-cable-or-a-tee"):
            objection(contract, test)


@pytest.mark.parametrize("test", ["no_block_comes_late", "the_clock_runs_at_the_sample_rate"])
def test_an_honest_clock_is_never_failed_on_a_host_that_is_late(test):
    assert objection_or_doubt(OverADriver(LateHost, Late), test) in ("", "unproven")


@pytest.mark.parametrize("host", [Late, LateUnseen])
def test_a_stall_of_a_host_that_was_late_is_not_held_against_the_driver(host):
    stalls = next(fault for fault in PLANTED if fault.driver.__name__ == "StallsFor50Ms")
    with refused(Unproven, "this-machine-was-too-busy"):
        objection(OverADriver(stalls.driver, host), stalls.test)


def test_a_clock_that_is_off_is_found_on_a_host_that_is_often_late():
    class Off(LateHost):
        rate_share = 1.01

    assert "+1.0" in objection(OverADriver(Off, Late), "the_clock_runs_at_the_sample_rate")


def test_the_page_has_the_table():
    page = (ROOT / "docs" / "reference" / "daq-contract.md").read_text(encoding="utf-8")
    assert BEGIN in page
    assert written(page) == page, "python -m tests.contract.planted docs/reference/daq-contract.md"


CONTINUING = sorted({fault.test for fault in PLANTED if issubclass(fault.driver, ContinuingDAQ)})


@pytest.mark.parametrize("test", CONTINUING)
def test_a_device_that_goes_on_as_it_says_is_proven_to(test):
    assert len(CONTINUING) == 4
    assert objection(OverADriver(ContinuingDAQ), test) == ""


@pytest.mark.parametrize("test", CONTINUING)
def test_a_device_that_does_not_say_that_it_goes_on_is_not_judged_by_it(test):
    for driver in (PacedDAQ, VirtualDAQ):
        with refused(NotApplicable, "does-not-say-waits-for-the"):
            getattr(OverADriver(driver), f"test_{test}")()
