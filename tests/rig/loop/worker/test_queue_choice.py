"""The queue of a run, measured at 0 V over a wire in memory with a clock of its own."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rig.bench.configuration import validated
from rig.drivers.wire import WireOptions
from rig.emulator import Faults
from rig.errors import ConfigurationError, DaqDisconnected, DaqError
from rig.loop.recommendation import RESERVE, Timing
from rig.loop.session import LocalSession
from rig.loop.worker.queue_choice import QueueChoice, covering_queue, settle_queue, usual_delay_s
from rig.wire.messages import DeviceState, EmergencyStop, Parameter
from tests.refused import refused
from tests.rig.loop.worker.rigs import tone
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ

BLOCK_S = 0.002
BENCH = bench_with({"block": 10})


@pytest.fixture
def made(monkeypatch):
    """Makes devices on a wire in memory, in whose time everything is measured; they hold late outputs unless they continue."""
    devices = []

    def make(options=None, bench=BENCH, continues=False, **keys):
        devices.append(MemoryDAQ(bench, 0, options, **{"lockstep": False, **keys}))
        if not continues:
            devices[-1].device.words[Parameter.LONGEST_PERIOD, 0] = 0
        return devices[-1]

    clock = SimpleNamespace(monotonic=lambda: devices[-1].wire.now_s, thread_time=lambda: 0.0)
    monkeypatch.setattr("rig.loop.worker.probe.time", clock)
    return make


def late(late_s):
    """Of all blocks one in a hundred, and everything after it, is late by ``late_s``."""
    return Faults(late_every=100, late_s=late_s)


def with_largest(daq, queue):
    daq.device.words[Parameter.LARGEST_QUEUE, 0] = queue
    return daq


def is_set(daq):
    """Queue and watchdog that the device was given, blocks and s."""
    daq.start(10)
    words = daq.device.words
    return words[Parameter.QUEUE, 0], 1e-6 * words[Parameter.WATCHDOG_US, 0]


def test_auto_is_the_default():
    assert WireOptions().queue_blocks == "auto"
    assert WireOptions().queue == 1
    assert WireOptions(queue_blocks=5).queue == 5


@pytest.mark.parametrize("wrong", ["automatic", 0, 65, 2.5, None, True])
def test_a_queue_that_is_none_is_one_line_that_says_what_is_allowed(wrong):
    with pytest.raises(ConfigurationError) as caught:
        validated(WireOptions, {"queue_blocks": wrong}, "driver.options")
    told = {"automatic": " = 'automatic'", None: ": is None"}.get(wrong, f" = {wrong}")
    assert str(caught.value) == f"driver.options: `queue_blocks`{told}; allowed: 1 to 64 blocks, or 'auto'"


@pytest.mark.parametrize("late_s", [0.0, 0.005, 0.010])
def test_the_shortest_queue_that_covers_the_lateness_is_taken_and_no_output_is_held_then(made, late_s):
    """One and a half times the lateness and half a block; the round trip in memory is below a tenth of a millisecond."""
    with made(faults=late(late_s)) as daq:
        choice = settle_queue(daq, BENCH)
        needed = RESERVE * late_s / BLOCK_S + 0.5
        assert math.ceil(needed) <= choice.blocks <= math.ceil(needed + 0.05)
        assert choice.how == "measured"
        assert choice.latency_samples == 10 * choice.blocks + 1.0 + daq.filter_delay_samples
        assert is_set(daq) == (choice.blocks, pytest.approx(0.1))
        for _ in range(1000):
            daq.exchange(np.zeros(10))
        assert daq.counters["output_held"] == daq.counters["output_continued"] == 0


def test_a_device_that_continues_needs_a_queue_for_99_percent_of_the_blocks(made):
    """One block in a hundred is late by 5 ms, another one by 80 ms: the first counts, the second is continued."""
    with made(continues=True) as daq:
        timing = Timing(late_s=0.080, gap_s=0.082, round_trip_s=0.0, busy_s=0.0, late_99_s=0.005)
        blocks, why = covering_queue(timing, BENCH, daq.adjustable)
        assert blocks == 3  # 5 ms and half of 2 ms
        assert "99 % of the blocks came within 5 ms, later ones are continued by the device" in why
        assert "too late" not in why
        period = round(5000 / 24.37)
        for longest, needed in ((period + 1, 3), (period - 2, 9)):  # one that cannot keep a period holds its output
            assert covering_queue(timing, BENCH, daq.adjustable._replace(longest_period=longest))[0] == needed


def test_what_is_measured_tells_the_lateness_of_99_percent(made):
    with made(continues=True, faults=Faults(late_every=300, late_s=0.015)) as daq:
        choice = settle_queue(daq, BENCH)
        assert choice.blocks < 9
        assert "99 % of the blocks came within" in choice.text


def test_the_line_says_how_long_the_queue_lasts_and_what_for(made):
    with made(faults=late(0.005)) as daq:
        choice = settle_queue(daq, BENCH)
    assert choice.remark == choice.text
    assert choice.text.startswith(f"queue_blocks = {choice.blocks} (auto): lasts {2 * choice.blocks} ms; ")
    assert "counted 1.5 times" in choice.text
    assert "\n" not in choice.text


def test_a_number_stays_a_number_and_measures_nothing(made):
    bench = bench_with({"block": 10})
    bench.driver.options["queue_blocks"] = 3
    with made(WireOptions(queue_blocks=3), bench) as daq:
        began = daq.wire.now_s
        assert settle_queue(daq, bench) == QueueChoice("bench", 3, 31.0 + daq.filter_delay_samples, "")
        assert settle_queue(daq, bench).remark == ""
        assert daq.wire.now_s == began
        assert is_set(daq)[0] == 3


def test_a_device_that_waits_for_the_host_gets_one_block_at_once(made):
    with made(lockstep=True, simulated=2) as daq:
        began = daq.wire.now_s
        choice = settle_queue(daq, BENCH)
        assert (choice.how, choice.blocks, choice.remark) == ("lockstep", 1, "")
        assert daq.wire.now_s == began
        assert is_set(daq)[0] == 1


@pytest.mark.parametrize(
    ("largest", "watchdog_s", "blocks", "bound"),
    [
        (64, None, 50, "within 0.1 s"),
        (16, None, 16, "that the device has"),
        (64, 0.05, 25, "within 0.05 s"),
        (64, 0.5, 50, "within 0.1 s"),
    ],
)
def test_a_plan_without_feedback_gets_the_longest_queue_up_to_the_watchdog_unmeasured(
    made, largest, watchdog_s, blocks, bound
):
    with with_largest(made(WireOptions(watchdog_s=watchdog_s)), largest) as daq:
        began = daq.wire.now_s
        choice = settle_queue(daq, BENCH, feedback=False)
        assert (choice.how, choice.blocks) == ("open loop", blocks)
        assert f"the longest {bound}" in choice.remark
        assert daq.wire.now_s == began
        assert is_set(daq) == (blocks, pytest.approx(watchdog_s or 0.1))


@pytest.mark.parametrize(
    ("largest", "watchdog_s", "delay_s", "blocks", "bound"),
    [
        (4, None, math.inf, 4, "that the device has"),
        (64, 0.016, math.inf, 8, "within 0.016 s, for nothing shall act later than the watchdog would"),
        (64, None, math.inf, 9, "with which the loop's delay stays within 20.5 ms"),  # half a period of 24.37 Hz
        (64, None, 0.0201, 8, "with which the loop's delay stays within 19.8 ms"),  # 20.1 less 0.3 ms of the filters
        (64, None, 0.001, 1, "with which the loop's delay stays within 0.703 ms"),
    ],
)
def test_where_the_longest_queue_would_be_late_it_is_taken_and_the_line_says_so(
    made, largest, watchdog_s, delay_s, blocks, bound
):
    """Queue, block and a sample of hold are within the loop's delay: (1 + q) 2 ms + 0.2 ms."""
    with with_largest(made(WireOptions(watchdog_s=watchdog_s), faults=late(0.080)), largest) as daq:
        choice = settle_queue(daq, BENCH, delay_s=delay_s)
        assert choice.blocks == blocks
        assert f"; that would be 61 blocks, and {blocks} are the longest {bound}: " in choice.text  # 1.5 x 80 ms + 1 ms
        assert choice.text.endswith(": some outputs will come too late")
        assert is_set(daq)[0] == blocks


def test_a_loop_may_take_ten_milliseconds_at_any_frequency_and_half_a_period_at_a_low_one():
    for name, delay_s in (("magnet-beam", 0.5 / 24.37), ("friction-beam", 0.01)):
        assert usual_delay_s(bench_with(name=name)) == pytest.approx(delay_s)


def test_all_outputs_are_0_v_nothing_latches_and_the_device_stands_still_afterwards(made, monkeypatch):
    sent = []
    exchange = MemoryDAQ.exchange
    monkeypatch.setattr(
        MemoryDAQ, "exchange", lambda daq, volts: (sent.append(abs(volts).max()), exchange(daq, volts))[1]
    )
    with made(faults=late(0.150)) as daq:  # longer than the watchdog of the bench
        settle_queue(daq, BENCH)
        assert daq.device.state is DeviceState.IDLE
    assert len(sent) > 500
    assert max(sent) == 0.0


def test_a_measurement_ends_as_soon_as_it_is_asked_to(made):
    with made() as daq:
        asked = iter(["", "", "the loop's process was asked to end (SIGTERM)"])
        with refused(DaqError, "message"):
            settle_queue(daq, BENCH, asked=lambda: next(asked))
        daq.close()
        daq.wire.run_device()
        assert daq.device.state is DeviceState.IDLE


def test_a_device_unplugged_meanwhile_is_the_error_and_not_what_follows_from_it(made):
    with made() as daq:

        def unplugged():
            daq.wire.cut = True
            return ""

        with refused(DaqDisconnected, "the-cable-is-unplugged"):
            settle_queue(daq, BENCH, asked=unplugged)


def test_a_session_measures_once_and_also_if_nobody_asked(made):
    with made(faults=late(0.005)) as daq:
        session = LocalSession(daq, BENCH, realtime=False)
        loop = session.start(tone(BENCH, 0.2))
        assert daq.queue_blocks == 5
        lead = loop.tick.arrays.loop
        # block and queue; half a sample of hold, and the filters
        assert lead["delay_whole"][0] == 60 + int(0.5 + daq.filter_delay_samples)
        for _ in loop.run():
            pass
    with made() as daq:
        session = LocalSession(daq, BENCH, realtime=False)
        assert session.settle_queue(feedback=False).blocks == 50
        began = daq.wire.now_s
        session.start(tone(BENCH, 0.2)).bring_down()
        assert daq.queue_blocks == 50
        assert daq.wire.now_s - began < 1.0


def test_what_has_latched_is_cleared_before_it_is_measured(made):
    daq = made()
    daq.device.handle(EmergencyStop(), 0.0)
    with daq:
        session = LocalSession(daq, BENCH, realtime=False)
        assert session.latched
        assert session.settle_queue().how == "measured"


def test_a_driver_without_a_queue_has_no_choice(made):
    assert settle_queue(SimpleNamespace(adjustable=None), BENCH) is None


def test_the_rule_by_hand():
    """1.5 x 2.1 ms + 0.85 ms, and half a block of 2 ms, are 5 ms: three blocks."""
    allowed = MemoryDAQ(BENCH, 0)
    with allowed as daq:
        blocks, why = covering_queue(Timing(0.0021, 0.004, 0.00085, 0.0), BENCH, daq.adjustable)
    assert blocks == 3
    assert why.startswith("lasts 6 ms; 5 ms are needed")
