"""One backbone over several wires: points are those without a wire, and what a bus loses is a gap, never a wrong point."""

from itertools import count
from typing import Any

import numpy as np
import pytest

import rig
from rig.bench import Bench, load_bench
from rig.campaigns.evaluation.lost_samples import lost_rows
from rig.emulator.emulated import emulated
from rig.measurements import point_rows
from rig.recording.reader import Recording
from rig.wire.can.slcan import SlcanBus
from tests.rig.campaigns.running.test_runs import plan_with

QUEUE = 1
BLOCKS = {"shipped": 14, "1 kHz": 4}  # two frames of CAN FD, four classical ones
EQUAL = {"frequency_hz": 1e-8, "damping_ratio": 1e-6, "amplitude_m": 1e-6, "force_n": 1e-6}
PLAN = plan_with(levels_v=(0.4, 0.8), record_periods=10)


def bench_at(rate: str) -> Bench:
    """The magnet beam with the queue of a device, as shipped or at a rate that classical CAN can carry."""
    table = load_bench("magnet-beam").model_dump()
    options = table["driver"]["options"]
    options["queue_blocks"] = QUEUE
    if rate == "1 kHz":
        options["converter"] = {"substeps": 10, "anti_alias_hz": 0.0, "oversampling": 1}
        table["sample_rate_hz"] = 1000.0
        table["limits"]["frequency_hz"] = (8.0, 200.0)
    return Bench.model_validate(table | {"block": BLOCKS[rate]})


@pytest.fixture(scope="module")
def without_wire() -> dict[str, list[dict[str, Any]]]:
    out = {}
    for rate in BLOCKS:
        with rig.run(PLAN, bench=bench_at(rate), seed=1) as run:
            assert run.complete
            out[rate] = run.recording.points
    return out


@pytest.mark.parametrize(
    ("wire", "settings", "rate"),
    [("serial", {}, "1 kHz"), ("can", {"fd": False}, "1 kHz"), ("can", {"fd": True}, "shipped")],
    ids=["serial", "classical CAN", "CAN FD"],
)
def test_points_over_a_wire_are_those_of_the_virtual_rig_with_the_same_queue(wire, settings, rate, without_wire):
    require_points_of_the_virtual_rig(wire, rate, without_wire, **settings)


def require_nothing_lost(recording: Recording) -> None:
    """All counters are zero, but those of requests that a busy machine answers so late that they are asked again."""
    counters = recording.parts[-1].end["counters"]
    assert {name for name, times in counters.items() if times} <= {"retries", "stray_answers"}


def require_points_of_the_virtual_rig(
    wire: str, rate: str, without_wire: dict[str, list[dict[str, Any]]], **settings: Any
) -> None:
    with (
        emulated(bench_at(rate), wire, lockstep=True, seed=1, **settings) as bench,
        rig.run(PLAN, bench=bench, seed=1) as run,
    ):
        assert run.complete
        require_nothing_lost(run.recording)
        for point, wanted in zip(run.recording.points, without_wire[rate], strict=True):
            assert point["accepted"]
            for key, tolerance in EQUAL.items():
                assert point[key] == pytest.approx(wanted[key], rel=tolerance)


@pytest.mark.slow
def test_frames_that_a_bus_loses_are_gaps_that_are_counted_and_leave_the_point_right(monkeypatch, without_wire):
    receive, frames, every = SlcanBus.receive, count(1), 211

    def lossy(bus: SlcanBus, timeout_s: float):
        frame = receive(bus, timeout_s)
        samples = frame is not None and frame.identifier >= 0x300
        return None if samples and next(frames) % every == 0 else frame

    monkeypatch.setattr(SlcanBus, "receive", lossy)
    monkeypatch.setattr("rig.loop.worker.spawn.supported", lambda: False)  # the loop runs here, where the bus is ours
    with (
        emulated(bench_at("shipped"), "can", lockstep=True, seed=1) as bench,
        rig.run(PLAN, bench=bench, seed=1) as run,
    ):
        assert run.complete
        counters = run.recording.parts[-1].end["counters"]
        dropped = (next(frames) - 1) // every
        assert dropped > 20
        assert counters["incomplete_blocks"] == pytest.approx(dropped, abs=1)
        assert counters["lost_samples"] == pytest.approx(dropped * BLOCKS["shipped"], abs=BLOCKS["shipped"])
        for point, wanted in zip(run.recording.points, without_wire["shipped"], strict=True):
            assert point["accepted"]
            assert any("lost in transmission" in warning for warning in point["warnings"])
            rows = point_rows(run.recording, point["number"])
            lost = lost_rows(rows)
            assert point["lost_samples"] == lost.sum() > 0
            assert np.isnan(rows["inputs"][lost]).all()
            assert np.isfinite(rows["inputs"][~lost]).all()
            assert point["frequency_hz"] == pytest.approx(wanted["frequency_hz"], rel=1e-4)
            assert point["damping_ratio"] == pytest.approx(wanted["damping_ratio"], rel=2e-3)
            assert point["amplitude_m"] == pytest.approx(wanted["amplitude_m"], rel=1e-3)
