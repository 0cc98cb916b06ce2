"""A driver that breaks a rule is caught by the kit under the rule's name, in words and as JSON, and the command fails."""

import json
import time

import pytest

from rig.conformance import DriverContract
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqWatchdog
from tests.contract.planted.drivers import UnseenDAQ
from tests.contract.planted.hosts import Punctual
from tests.contract.planted.inputs import KNOWN, SwapsForceAndDrive
from tests.contract.planted.life_cycle import CountsDown


class SleepsLong(VirtualDAQ):
    def _exchange(self, voltages, inputs):
        time.sleep(0.6)
        super()._exchange(voltages, inputs)


class TripsOnce(VirtualDAQ):
    """Its device's watchdog bites after some starts, and stays latched until it is cleared."""

    is_latched, starts, moves = False, 0, False

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"virtual": not self.moves})

    def start(self, block=1):
        if TripsOnce.is_latched:
            raise DaqWatchdog("the watchdog had latched")
        TripsOnce.starts += 1
        super().start(block)

    def _exchange(self, voltages, inputs):
        if TripsOnce.starts == 2:
            TripsOnce.is_latched = True
            raise DaqWatchdog("no output came")
        super()._exchange(voltages, inputs)

    run_fused = None

    def clear(self):
        TripsOnce.is_latched = False


@pytest.fixture
def conformance(command, monkeypatch):
    """Run the kit on a driver."""

    def run(driver, *options):
        for place in ("run", "contract"):
            monkeypatch.setattr(f"rig.conformance.{place}.make_daq", driver)
        monkeypatch.setattr("rig.conformance.subject.HostWatch", Punctual)
        for limit in ("late_s", "prompt_s"):  # of a machine that the tests keep busy
            monkeypatch.setattr(DriverContract, limit, 10.0)
        for length in ("long_run_blocks", "late_blocks"):  # no rule that is broken here is broken rarely
            monkeypatch.setattr(DriverContract, length, 500)
        return command("conformance", "--bench", "magnet-beam", *options)

    return run


@pytest.mark.parametrize(
    ("driver", "test"),
    [
        (CountsDown, "counters are whole numbers that only grow"),
        (SwapsForceAndDrive, KNOWN.replace("_", " ")),
    ],
)
def test_the_kit_names_the_rule_that_is_broken(driver, test, conformance):
    done = conformance(driver, "--json")
    assert done.status == 1
    failed = {one["test"]: one["detail"] for one in json.loads(done.out)["tests"] if one["outcome"] == "failed"}
    assert test in failed
    assert all(text.partition(": ")[2] for text in failed.values()), "a failure without a message"


def test_a_driver_that_keeps_all_rules_passes_in_words_and_the_command_succeeds(conformance):
    done = conformance(VirtualDAQ)
    assert done.status == 0, done.out
    *lines, summary, unproven = done.out.splitlines()
    assert "failed" not in [line.split()[0] for line in lines]
    assert summary.startswith("driver virtual: ")
    assert " 0 failed, 7 not applicable, 1 unproven" in summary
    assert unproven.startswith("unproven: a device that is gone is a daq error and can be closed: ")


def test_what_is_unproven_is_summed_up_by_what_it_would_take(conformance):
    done = conformance(UnseenDAQ)
    assert done.status == 0, done.out
    last = done.out.partition("driver virtual: ")[2].splitlines()
    assert any("no witness sees the output" in line for line in last)
    assert any("handed over: no witness" in line for line in last)


@pytest.mark.parametrize("moves", [False, True])
def test_what_a_test_leaves_latched_is_cleared_before_the_next_only_where_nothing_moves(
    moves, conformance, monkeypatch
):
    for name, value in {"is_latched": False, "starts": 0, "moves": moves}.items():
        monkeypatch.setattr(TripsOnce, name, value)
    done = conformance(TripsOnce, "--json", *(["--arm"] if moves else []))
    failed = [test for test in json.loads(done.out)["tests"] if test["outcome"] == "failed"]
    assert (len(failed) > 1) == moves


def test_what_is_broken_stands_in_words_too(conformance):
    done = conformance(CountsDown)
    assert done.status == 1
    assert (
        "failed         counters are whole numbers that only grow: AssertionError: counters: crc_errors was "
        in done.out
    )


def test_a_driver_that_is_too_slow_for_any_test_is_not_tested_for_hours(conformance):
    done = conformance(SleepsLong, "--json")
    first, *others = json.loads(done.out)["tests"]
    assert first["outcome"] == "failed"
    assert "lasts 0.05 s and takes 0.6" in first["detail"]
    assert {(test["outcome"], test["detail"]) for test in others} == {
        ("not applicable", "the driver is too slow to be tested any further")
    }
