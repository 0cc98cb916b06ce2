"""A driver that breaks a rule is caught by the kit under the rule's name, in words and as JSON, and the command fails."""

import json
import time

import numpy as np
import pytest

from rig.bench import DriverChoice
from rig.daq import State
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqRefused, DaqWatchdog


class OpensItself(VirtualDAQ):
    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self.open()

    def open(self):
        if self.state is State.CLOSED:
            super().open()


class FailsWhereGone(VirtualDAQ):
    def close(self):
        if self.state is State.CLOSED:
            raise RuntimeError("not open")
        super().close()


class TakesAnyBlock(VirtualDAQ):
    def start(self, block=1):
        super().start(max(1, min(block, self.capabilities.largest_block)))


class MakesUpLostSamples(VirtualDAQ):
    run_fused = None

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[-1] = np.nan


class ClipsInSilence(VirtualDAQ):
    def exchange(self, voltages):
        return super().exchange(np.clip(np.nan_to_num(voltages), -self.output_range_v, self.output_range_v))


class KeepsItsOutput(VirtualDAQ):
    left_v = 0.0

    def _exchange(self, voltages, inputs):
        self.left_v = float(np.abs(voltages).max()) or self.left_v
        super()._exchange(voltages, inputs)
        inputs += self.left_v * np.sin(np.arange(len(inputs)))[:, np.newaxis]


class LendsItsInputs(VirtualDAQ):
    lent = None

    def exchange(self, voltages):
        answer = super().exchange(voltages)
        if self.lent is None or self.lent.shape != answer.shape:
            self.lent = answer
        self.lent[:] = answer
        return self.lent


class CountsDown(VirtualDAQ):
    calls = 0

    @property
    def counters(self):
        return {"crc_errors": 100 - self.calls}

    def _exchange(self, voltages, inputs):
        self.calls += 1
        super()._exchange(voltages, inputs)


class IdentifiesItselfByNumber(VirtualDAQ):
    @property
    def identity(self):
        return {"serial_number": 42}


class CannotStartAgain(VirtualDAQ):
    opened = 0

    def _open(self):
        self.opened += 1
        if self.opened > 1:
            raise DaqRefused("once is enough")
        super()._open()


class ShiftsItsOutputs(VirtualDAQ):
    """By one sample, across the blocks."""

    last_v = 0.0

    def _exchange(self, voltages, inputs):
        shifted = np.concatenate([[self.last_v], voltages[:-1]])
        self.last_v = voltages[-1]
        super()._exchange(shifted, inputs)


class LosesABlock(VirtualDAQ):
    calls = 0

    def _exchange(self, voltages, inputs):
        self.calls += 1
        super()._exchange(np.zeros_like(voltages) if self.calls % 30 == 0 else voltages, inputs)


class SaysNoLatency(VirtualDAQ):
    latency_samples = 0.0
    filter_delay_samples = 0.0


class SaysNoQueue(VirtualDAQ):
    """It has one; to be made over a bench without a loopback too."""

    def __init__(self, bench, seed=0):
        options = {**bench.driver.options, "queue_blocks": 1}
        super().__init__(bench.model_copy(update={"driver": DriverChoice(name="virtual", options=options)}), seed)

    @property
    def latency_samples(self):
        return super().latency_samples - self.block


class DoesNotStop(VirtualDAQ):
    def _stop(self):
        pass

    def _close(self):
        super()._stop()


class DoesNotClose(VirtualDAQ):
    def _close(self):
        pass


class KeepsItsQueue(VirtualDAQ):
    """Says that 0 V is out once it is handed over, and has not put it out."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages if voltages.any() else np.full_like(voltages, 0.05), inputs)


class StaysDrivenAfterAnException(VirtualDAQ):
    """Its stop asks for an exchange of its own, and gives up where that fails."""

    def _stop(self):
        self._exchange(np.zeros(self.block), np.zeros((self.block, len(self.channels))))
        super()._stop()

    def _close(self):
        super()._stop()


class SleepsForASecond(VirtualDAQ):
    def _exchange(self, voltages, inputs):
        time.sleep(1.0)
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
        if TripsOnce.starts == 5:
            TripsOnce.is_latched = True
            raise DaqWatchdog("no output came")
        super()._exchange(voltages, inputs)

    run_fused = None

    def clear(self):
        TripsOnce.is_latched = False


class WritesIntoTheVoltages(VirtualDAQ):
    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        voltages *= 0.5


RULES = {
    ShiftsItsOutputs: "the latency is that of the loopback",
    LosesABlock: "every output shows in the loopback once and in its order",
    SaysNoLatency: "the latency is that of the loopback",
    SaysNoQueue: "an output shows once its latency is over",
    DoesNotStop: "stop alone brings the output to 0 v",
    DoesNotClose: "close alone brings the output to 0 v",
    KeepsItsQueue: "0 v that are exchanged are on the converter",
    StaysDrivenAfterAnException: "an exception in exchange ends at 0 v",
    SleepsForASecond: "a block takes no longer than it lasts",
    WritesIntoTheVoltages: "the voltages handed over are left as they are",
    OpensItself: "nothing is opened by the constructor",
    FailsWhereGone: "close may be called at any time and again",
    TakesAnyBlock: "blocks beyond the device are refused with what is allowed",
    MakesUpLostSamples: "lost samples are rows of nan with their flag and nothing else is",
    ClipsInSilence: "voltages beyond the range or not a number are refused",
    KeepsItsOutput: "stop leaves the output at zero",
    LendsItsInputs: "the voltages handed over are not kept",
    CountsDown: "counters are whole numbers that only grow",
    IdentifiesItselfByNumber: "the device says who it is in words",
    CannotStartAgain: "a driver may be opened again",
}


@pytest.fixture
def conformance(command, monkeypatch):
    """Run the kit on a driver."""

    def run(driver, *options):
        monkeypatch.setattr("rig.conformance.run.make_daq", driver)
        return command("conformance", "--bench", "magnet-beam", *options)

    return run


@pytest.mark.parametrize("driver", RULES, ids=lambda driver: driver.__name__)
def test_the_kit_names_the_rule_that_is_broken(driver, conformance):
    done = conformance(driver, "--json")
    assert done.status == 1
    failed = {test["test"]: test["detail"] for test in json.loads(done.out)["tests"] if test["outcome"] == "failed"}
    assert RULES[driver] in failed
    assert all(failed.values()), "a failure without a word"


def test_a_driver_that_keeps_all_rules_passes_in_words_and_the_command_succeeds(conformance):
    done = conformance(VirtualDAQ)
    assert done.status == 0, done.out
    *lines, summary = done.out.splitlines()
    assert "failed" not in [line.split()[0] for line in lines]
    assert summary.startswith("driver virtual: ")
    assert " 0 failed, 2 not applicable" in summary


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
    assert f"failed         {RULES[CountsDown]}: " in done.out


def test_a_driver_that_is_too_slow_for_any_test_is_not_tested_for_hours(conformance):
    done = conformance(SleepsForASecond, "--json")
    first, *others = json.loads(done.out)["tests"]
    assert first["outcome"] == "failed"
    assert "lasts 0.05 s and takes 1" in first["detail"]
    assert {(test["outcome"], test["detail"]) for test in others} == {
        ("not applicable", "the driver is too slow to be tested any further")
    }
