"""What ``rig doctor --daq`` measures, recommends and tries, over a wire in memory with a clock of its own."""

import math
from types import SimpleNamespace

import pytest

from rig.bench import load_bench
from rig.drivers.wire import WireOptions
from rig.emulator import Faults
from rig.errors import DaqRefused
from rig.loop.recommendation import Settings
from rig.loop.session import LocalSession
from rig.loop.worker.examination import _that_opens, examine_device, with_settings
from rig.loop.worker.probe import round_trips
from rig.wire.messages import DeviceState, EmergencyStop, Parameter
from tests.refused import refused
from tests.rig.loop.worker.rigs import tone
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ

BLOCK_S = 0.002
AUTO = bench_with({"block": 10})
BENCH = bench_with({"block": 10}, queue_blocks=1)


@pytest.fixture
def examined(monkeypatch):
    """Devices behind a wire in memory, in whose time everything is measured; ``keys`` are those of the next devices."""
    made = SimpleNamespace(keys={"lockstep": False}, devices=[], latched=False, faults=[], words={})

    def make(bench, seed=0):
        options, of_the_wire = dict(bench.driver.options), WireOptions.model_fields
        options.pop("loop", None)
        wired = WireOptions(**{name: options.pop(name) for name in [*options] if name in of_the_wire})
        driver = bench.driver.model_copy(update={"options": options})
        daq = MemoryDAQ(bench.model_copy(update={"driver": driver}), seed, wired, **made.keys)
        if made.faults:  # of each device in turn, the last of them for all that follow
            daq.device.faults = made.faults[min(len(made.devices), len(made.faults) - 1)]
            daq.device._sender._faults = daq.device.faults
        daq.device.words.update(made.words)
        if made.latched:
            daq.device.handle(EmergencyStop(), 0.0)
        made.devices.append(daq)
        return daq

    clock = SimpleNamespace(monotonic=lambda: made.devices[-1].wire.now_s, thread_time=lambda: 0.0)
    for module in ("probe", "examination"):
        monkeypatch.setattr(f"rig.loop.worker.{module}.make_daq", make)
    monkeypatch.setattr("rig.loop.worker.probe.time", clock)
    monkeypatch.setattr("rig.loop.worker.probe.prepare", lambda **keys: {})
    return made


def late(made, late_s):
    """Of all blocks one in a hundred, and everything after it, is late by ``late_s``."""
    made.keys["faults"] = Faults(late_every=100, late_s=late_s)


def test_a_device_that_runs_the_loop_needs_no_queue_and_nothing_is_tried(examined, monkeypatch):
    monkeypatch.setattr("rig.loop.worker.examination.who_runs", lambda daq, bench: (True, ""))
    options = {**BENCH.driver.options, "loop": "device"}
    bench = BENCH.model_copy(update={"driver": BENCH.driver.model_copy(update={"options": options})})
    late(examined, 0.05)
    facts = examine_device(bench, 0)
    assert facts["block"] == 100
    assert facts["recommendation"]["settings"] == {}
    assert "needs no queue" in facts["recommendation"]["reasons"]["queue_blocks"]
    assert facts["recommendation"]["tried"] == facts["recommendation"]["bench_lines"] == []


def test_a_device_on_time_is_left_with_the_settings_of_the_bench(examined):
    facts = examine_device(BENCH, 0)
    advice = facts["recommendation"]
    assert advice["settings"] == {"block": 10, "queue_blocks": 1, "watchdog_s": 0.1, "largest_rate_hz": 5000.0}
    assert advice["differs"] == {}
    assert advice["bench_lines"] == []
    assert advice["holds"]
    assert facts["remarks"] == []
    assert facts["held_blocks"] == 0
    assert facts["queue_blocks"] == 1


@pytest.mark.parametrize("late_s", [0.005, 0.030, 0.060])
def test_a_device_that_answers_late_by_a_known_time_gets_a_queue_that_covers_it_and_then_holds_none(examined, late_s):
    """One and a half times the lateness and half a block; the round trip in memory is below a tenth of a millisecond."""
    late(examined, late_s)
    facts = examine_device(BENCH, 0)
    advice = facts["recommendation"]
    needed = 1.5 * late_s / BLOCK_S + 0.5
    assert math.ceil(needed) <= advice["settings"]["queue_blocks"] <= math.ceil(needed + 0.05)
    assert advice["measured"]["late_s"] == pytest.approx(late_s, abs=1e-4)
    assert advice["holds"]
    tried = advice["tried"][0]
    assert tried["queue_blocks"] == advice["settings"]["queue_blocks"]
    assert tried["held_blocks"] == 0
    assert tried["blocks"] >= 400
    too_short = Settings(10, math.floor(late_s / BLOCK_S), 1.0)
    assert round_trips(with_settings(BENCH, too_short, 5000.0), 0, 1.0)["held_blocks"] > 0


def test_held_outputs_and_a_queue_that_is_too_short_are_remarked(examined):
    late(examined, 0.030)
    facts = examine_device(BENCH, 0)
    assert facts["held_blocks"] > 0
    held, short = facts["remarks"]
    assert held == f"outputs were held in {facts['held_blocks']} of {facts['blocks']} blocks: they came too late"
    assert "the queue of 1 blocks lasts 2 ms" in short


def test_a_bench_that_leaves_its_queue_to_the_run_needs_no_lines_and_is_tried_with_what_it_would_take(examined):
    late(examined, 0.008)
    examined.words[Parameter.LONGEST_PERIOD, 0] = 0
    facts = examine_device(AUTO, 0)
    advice = facts["recommendation"]
    assert advice["settings"]["queue_blocks"] == 7  # 12 ms and half of 2 ms, and the round trip
    assert advice["differs"] == {}
    assert advice["bench_lines"] == []
    assert advice["reasons"]["queue_blocks"].startswith('as "auto" takes it before a run: lasts 14 ms; ')
    assert facts["remarks"] == []
    assert facts["held_blocks"] == 0
    assert facts["queue_blocks"] == 7


def test_where_what_auto_would_take_does_not_hold_a_number_is_recommended(examined):
    """Nothing is late while it is measured; from then on blocks are late by 5 ms."""
    examined.faults = [Faults(), Faults(), Faults(late_every=100, late_s=0.005)]
    advice = examine_device(AUTO, 0)["recommendation"]
    assert advice["bench_lines"] == ["[driver.options]", "queue_blocks = 4"]
    assert advice["reasons"]["queue_blocks"].startswith("lasts")


def test_a_longer_block_leaves_the_queue_to_the_run(examined):
    """A wire that cannot carry blocks of one sample."""
    examined.keys |= {"available_bit_s": 0.85e6, "faults": Faults(late_every=100, late_s=0.005)}
    advice = examine_device(bench_with({"block": 1}), 0)["recommendation"]
    assert advice["bench_lines"] == ["block = 2"]
    assert advice["settings"]["queue_blocks"] > 1


def test_the_lines_for_the_bench_make_a_bench_with_the_recommended_settings(examined, tmp_path):
    late(examined, 0.060)
    advice = examine_device(BENCH, 0)["recommendation"]
    (tmp_path / "mine.toml").write_text(
        'base = "magnet-beam"\nblock = 10\n[driver]\nname = "serial"\noptions.port = "p"\n'
    )
    (tmp_path / "better.toml").write_text("\n".join(['base = "mine.toml"', *advice["bench_lines"]]))
    options = load_bench(tmp_path / "better.toml").driver.options
    assert options == {"port": "p", **advice["differs"]}
    assert {"queue_blocks", "watchdog_s"} == set(advice["differs"])


def test_a_run_with_the_recommended_settings_holds_none_and_one_with_those_of_the_bench_does(examined):
    late(examined, 0.030)
    settings = examine_device(BENCH, 0)["recommendation"]["settings"]
    counted = []
    for queue in (settings["queue_blocks"], 1):
        options = WireOptions(queue_blocks=queue, watchdog_s=settings["watchdog_s"])
        with MemoryDAQ(BENCH, 0, options, **examined.keys) as daq:
            loop = LocalSession(daq, BENCH, realtime=False).start(tone(BENCH, 1.0))
            rows = sum(chunk.size for chunk in loop.run())
            assert rows > 5000
            counted.append(daq.counters["output_held"] + daq.counters["output_continued"])
    assert counted[0] == 0
    assert counted[1] > 100


def test_a_watchdog_that_would_end_the_examination_is_not_tried_and_nothing_latches(examined):
    late(examined, 0.150)
    facts = examine_device(BENCH, 0)
    assert facts["recommendation"]["settings"]["watchdog_s"] == pytest.approx(0.46, abs=0.02)
    assert any("were not tried" in remark for remark in facts["remarks"])
    assert any("watchdog's 0.1 s are shorter" in remark for remark in facts["remarks"])
    assert [told["watchdog_s"] for told in facts["recommendation"]["tried"]] != [0.1]
    assert all(daq.device.state is not DeviceState.LATCHED for daq in examined.devices)


def test_a_wire_that_cannot_carry_the_blocks_of_the_bench_gets_longer_ones(examined):
    examined.keys["available_bit_s"] = (
        0.85e6  # a block of one sample takes 5000 x 8 x (12 + 2 x 2) bit/s, of two the half
    )
    facts = examine_device(bench_with({"block": 1}), 0)
    advice = facts["recommendation"]
    assert "of the wire" in facts["remarks"][0]
    assert advice["settings"]["block"] == 2
    assert advice["differs"]["block"] == 2
    assert advice["holds"]


def test_a_queue_that_does_not_hold_when_it_is_tried_is_doubled_until_it_does(examined):
    """Nothing is late while it is measured; from then on blocks are late by 5 ms: 2.5 of 2 ms, and four are needed."""
    examined.faults = [Faults(), Faults(), Faults(late_every=100, late_s=0.005)]
    facts = examine_device(bench_with({"block": 10}), 0)
    advice = facts["recommendation"]
    assert [told["queue_blocks"] for told in advice["tried"]] == [1, 2, 4]
    assert [told["held_blocks"] > 0 for told in advice["tried"]] == [True, True, False]
    assert advice["settings"]["queue_blocks"] == 4
    assert advice["holds"]
    assert "tried with 2: " in advice["reasons"]["queue_blocks"]


def test_where_the_rate_is_not_reached_the_block_grows_and_the_queue_lasts_as_long(examined, monkeypatch):
    """The computer has only 4.5 of 5 kHz in blocks of fewer than 30 samples, and then all."""
    measured = round_trips

    def slow(bench, seed, seconds):
        facts = measured(bench, seed, seconds)
        return facts | ({"reached_hz": 4500.0} if bench.block < 30 else {})

    monkeypatch.setattr("rig.loop.worker.examination.round_trips", slow)
    late(examined, 0.0099)  # 14.85 ms and half a block: 8 blocks of 2 ms
    advice = examine_device(BENCH, 0)["recommendation"]
    assert [(told["block"], told["queue_blocks"]) for told in advice["tried"][:2]] == [(10, 8), (50, 3)]
    assert (advice["settings"]["block"], advice["settings"]["queue_blocks"]) == (50, 3)
    assert "tried with 10: 0 of " in advice["reasons"]["block"]
    assert advice["holds"]


def test_a_higher_rate_of_the_device_is_tried_and_told(examined):
    examined.words = {(Parameter.HIGHEST_RATE_MHZ, 0): 20_000_000}
    advice = examine_device(BENCH, 0)["recommendation"]
    assert advice["settings"]["largest_rate_hz"] == 20_000.0
    assert advice["tried"][-1]["sample_rate_hz"] == 20_000.0
    assert advice["tried"][-1]["held_blocks"] == 0
    assert advice["reasons"]["largest_rate_hz"].endswith("; tried")


def test_a_higher_rate_that_loses_blocks_is_not_told(examined):
    """One block in a hundred is lost from the fourth time on that the device is opened, the first at a higher rate."""
    examined.words = {(Parameter.HIGHEST_RATE_MHZ, 0): 20_000_000}
    examined.faults = [Faults()] * 3 + [Faults(drop_every=100)]
    advice = examine_device(BENCH, 0)["recommendation"]
    assert [told["sample_rate_hz"] for told in advice["tried"]] == [5000.0, 20_000.0, 10_000.0]
    assert advice["settings"]["largest_rate_hz"] == 5000.0


def test_a_watchdog_that_trips_all_the_same_ends_the_examination_and_is_left(examined):
    """From the third time on that the device is opened, for the first try, it is soon deaf to the host."""
    examined.faults = [Faults(), Faults(), Faults(deaf_after_s=0.3)]
    facts = examine_device(BENCH, 0)
    assert [told["failure"].split(":")[0] for told in facts["recommendation"]["tried"]] == ["DaqWatchdog"]
    assert not facts["recommendation"]["holds"]
    assert facts["remarks"][-1].startswith("the watchdog has latched while settings were tried")
    assert examined.devices[-1].device.state is DeviceState.LATCHED


def test_a_latched_device_is_left_as_it_is(examined):
    examined.latched = True
    facts = examine_device(BENCH, 0)
    assert "emergency stop had latched" in facts["latched"]
    assert "recommendation" not in facts
    assert all(daq.device.state is DeviceState.LATCHED for daq in examined.devices)


@pytest.mark.slow
def test_a_device_that_waits_for_the_host_needs_no_settings(examined):
    examined.keys |= {"lockstep": True, "simulated": 2}
    facts = examine_device(BENCH, 0, seconds=0.2)
    assert facts["recommendation"]["settings"] == {}
    assert "waits for the host" in facts["recommendation"]["reasons"]["queue_blocks"]


def test_all_outputs_are_0_v(examined, monkeypatch):
    sent = []
    exchange = MemoryDAQ.exchange
    monkeypatch.setattr(
        MemoryDAQ, "exchange", lambda daq, volts: (sent.append(abs(volts).max()), exchange(daq, volts))[1]
    )
    examine_device(BENCH, 0)
    assert len(sent) > 1000
    assert max(sent) == 0.0


@pytest.mark.parametrize(("block", "least", "taken"), [(1, 2, 2), (1, 3, 5), (10, 11, 20), (2, 37, 50), (50, 120, 200)])
def test_of_a_device_that_refuses_short_blocks_the_next_longer_one_of_the_series_1_2_5_is_examined(
    monkeypatch, block, least, taken
):
    def asked(bench, seed):
        if bench.block < least:
            raise DaqRefused(f"needs blocks of {least} samples")
        return bench.block

    monkeypatch.setattr("rig.loop.worker.examination._asked", asked)
    bench = bench_with({"block": block})
    longer, known, refusal = _that_opens(bench, 0)
    assert (longer.block, known, refusal) == (taken, taken, f"needs blocks of {least} samples")
    assert longer == bench.model_copy(update={"block": taken})


def test_a_device_that_refuses_every_block_that_a_bench_may_have_is_not_examined(monkeypatch):
    tried = []

    def asked(bench, seed):
        tried.append(bench.block)
        raise DaqRefused("no bus")

    monkeypatch.setattr("rig.loop.worker.examination._asked", asked)
    with refused(DaqRefused, "no-bus"):
        _that_opens(bench_with({"block": 10}), 0)
    assert tried == [10, 20, 50, 100, 200, 500, 1000]  # 0.2 s at 5 kHz
