"""The host of protocol version 2: it states periods, and takes what was put out in place of what came too late."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rig.continuation import period_steps
from rig.drivers.wire import WireOptions
from rig.emulator import Faults
from rig.wire.link import Link
from rig.wire.messages import DeviceFlag, Message, Output, Parameter, Readback
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ, MemoryLink, MemoryWire

BLOCK, QUEUE = 10, 2
RATE_HZ = 5000.0
FREQUENCY_HZ = 149.0
PERIOD = RATE_HZ / FREQUENCY_HZ


class Watched(MemoryLink):
    """The host's end, which notes the outputs and may keep messages back."""

    def __init__(self, wire: MemoryWire, keep: Callable[[Message], bool]) -> None:
        super().__init__(wire, host=True)
        self.outputs: list[Output] = []
        self._keep = keep

    def send(self, message: Message) -> None:
        if isinstance(message, Output):
            self.outputs.append(message)
        super().send(message)

    def receive(self, timeout_s: float) -> Message | None:
        message = super().receive(timeout_s)
        while message is not None and not self._keep(message):
            message = super().receive(timeout_s)
        return message


class Host(MemoryDAQ):
    """A driver of version 2 over a wire in memory."""

    def __init__(self, keep: Callable[[Message], bool] = lambda _: True, faults: Faults | None = None) -> None:
        super().__init__(bench_with(), 3, WireOptions(queue_blocks=QUEUE), lockstep=False, faults=faults)
        self._watch = keep

    def _make_link(self) -> Link:
        self.link = Watched(self.wire, self._watch)
        return self.link


def sine(block: int) -> np.ndarray:
    return 1.3 * np.sin(2.0 * math.pi * np.arange(block * BLOCK, (block + 1) * BLOCK) / PERIOD)


def run(daq: Host, blocks: int, pauses: dict[int, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flags, what was put out in place, and outputs of the device in volts, by sample; pauses in s before a call."""
    flags, put_out, output_v = [], [], []
    step = daq.device._measure

    def measure(now_s: float) -> None:
        step(now_s)
        output_v.append(daq.device.output_v.copy())

    daq.device._measure = measure  # type: ignore[method-assign]
    with daq:
        daq.start(BLOCK)
        for j in range(blocks):
            if j in pauses:
                daq.wire.pass_time(pauses[j])
            daq.continuation[0] = (PERIOD, 0.0)
            daq.exchange(sine(j + QUEUE))
            flags.append(daq.flags.copy())
            put_out.append(daq.put_out.copy())
    return np.concatenate(flags), np.concatenate(put_out), np.concatenate(output_v)[: blocks * BLOCK]


def test_the_row_holds_what_was_put_out_where_that_was_not_what_was_handed_over() -> None:
    daq = Host()
    flags, put_out, output_v = run(daq, 60, {20: 0.05})
    handed = np.concatenate([np.zeros(QUEUE * BLOCK), *(sine(j) for j in range(QUEUE, 60))])
    step_v = daq.device.plant.output_v_per_count
    late = flags & DeviceFlag.OUTPUT_CONTINUED != 0
    assert late.any()
    rows = np.where(np.isfinite(put_out), put_out, handed)
    began = QUEUE * BLOCK
    assert np.abs(rows[began:] - output_v[began:]).max() <= 0.5 * step_v + 1e-9
    counts = [np.rint(volts[began:] / step_v) for volts in (handed, output_v)]
    np.testing.assert_array_equal(np.isnan(put_out[began:]), counts[0] == counts[1])
    assert np.isnan(put_out[~late]).all()
    np.testing.assert_allclose(put_out[np.isfinite(put_out)], output_v[np.isfinite(put_out)], atol=1e-9)
    assert np.abs(output_v[began:] - handed[began:]).max() <= 1.3 * 0.005  # the vibration goes on
    assert daq.counters["output_continued"] == late.sum() == BLOCK * daq.device.counts["continued_blocks"]
    assert daq.counters["output_held"] == daq.counters["missing_readbacks"] == daq.counters["lost_samples"] == 0


def test_periods_and_ramps_are_stated_with_each_block() -> None:
    daq = Host()
    with daq:
        daq.start(BLOCK)
        for told in ((PERIOD, 0.0), (PERIOD, 499.2), (0.0, 0.0), (math.nan, math.nan)):
            daq.continuation[0] = told
            daq.exchange(np.zeros(BLOCK))
    said = [(one.period, one.ramp) for one in daq.link.outputs]
    assert said == [(period_steps(PERIOD), 0), (period_steps(PERIOD), 500), (0, 0), (0, 0)]
    assert period_steps(PERIOD) == round(65536 * RATE_HZ / FREQUENCY_HZ)


def test_a_flagged_block_without_its_readback_is_a_gap() -> None:
    dropped: list[int] = []

    def keep(message: Message) -> bool:
        if isinstance(message, Readback) and not dropped:
            dropped.append(message.first)
            return False
        return True

    daq = Host(keep)
    with daq:
        daq.start(BLOCK)
        rows = []
        for j in range(60):
            if j == 20:
                daq.wire.pass_time(0.05)
            daq.continuation[0] = (PERIOD, 0.0)
            rows.append(daq.exchange(sine(j + QUEUE)))
    lost = np.flatnonzero(np.isnan(np.vstack(rows)).all(axis=1))
    np.testing.assert_array_equal(lost, np.arange(dropped[0], dropped[0] + BLOCK))
    assert daq.counters["lost_samples"] == BLOCK
    assert daq.counters["missing_readbacks"] == 1


def test_with_a_device_of_version_1_outputs_are_held_and_nothing_is_said_of_them() -> None:
    daq = Host(faults=Faults(version=1))
    flags, put_out, _ = run(daq, 60, {20: 0.05})
    assert daq.identity["protocol"] == "1"
    assert all((one.period, one.ramp) == (0, 0) for one in daq.link.outputs)
    assert np.isnan(put_out).all()
    assert daq.counters["output_held"] == np.count_nonzero(flags & DeviceFlag.OUTPUT_HELD) > 0
    assert daq.counters["output_continued"] == daq.counters["missing_readbacks"] == 0


def test_what_is_handed_over_at_0_v_is_held_and_read_back() -> None:
    daq = Host()
    with daq:
        daq.start(BLOCK)
        for j in range(60):
            if j == 20:
                daq.wire.pass_time(0.05)
            daq.exchange(sine(j + QUEUE) if j < 15 else np.zeros(BLOCK))
            assert np.isnan(daq.put_out).all()  # 0 V was handed over, and held
    assert daq.counters["output_held"] > 0 == daq.counters["output_continued"]


@pytest.mark.parametrize(("lowest", "highest", "used"), [(1, 1, "1"), (1, 2, "2"), (1, 7, "2"), (2, 7, "2")])
def test_the_latest_version_that_both_speak_is_used(lowest: int, highest: int, used: str) -> None:
    daq = Host()
    daq.device.words[Parameter.LOWEST_VERSION, 0] = lowest
    daq.device.words[Parameter.HIGHEST_VERSION, 0] = highest
    with daq:
        assert daq.identity["protocol"] == used
        assert daq.device.words[Parameter.VERSION, 0] == int(used)
        assert daq.identity["longest_period"] == ("16384" if used == "2" else "0")


@pytest.mark.parametrize("lockstep", [True, False])
def test_what_the_rig_behind_the_device_has_held_by_its_own_faults_is_read_back_too(lockstep: bool) -> None:
    faults = {"held_per_s": 40.0, "held_s": 0.002}
    bench = bench_with()
    driver = bench.driver.model_copy(update={"options": {**bench.driver.options, "faults": faults}})
    bench = bench.model_copy(update={"driver": driver, "block": BLOCK})
    daq = MemoryDAQ(bench, 3, WireOptions(queue_blocks=QUEUE), lockstep=lockstep)
    plant, held = daq.device.plant, []
    step = plant.step

    def watched(volts: np.ndarray) -> tuple[np.ndarray, int]:
        out = step(volts)
        held.append(plant.put_out.copy())
        return out

    plant.step = watched
    put_out = []
    with daq:
        daq.start(BLOCK)
        for j in range(200):
            daq.exchange(sine(j + QUEUE))
            put_out.append(daq.put_out.copy())
    got, wanted = np.concatenate(put_out), np.concatenate(held)[: 200 * BLOCK]
    assert np.isfinite(wanted).any()
    handed = np.concatenate([np.zeros(QUEUE * BLOCK), *(sine(j) for j in range(QUEUE, 200))])
    step_v = plant.output_v_per_count
    replaced = np.isfinite(wanted) & (np.abs(wanted - handed) > step_v)
    assert replaced.any()
    np.testing.assert_allclose(got[replaced], wanted[replaced], atol=0.51 * step_v)
    assert np.isnan(got[~np.isfinite(wanted)]).all()
