"""A backbone over an adapter that hands frames over in another order: put right without a trace in the points, or named."""

from collections import deque
from itertools import count

import pytest

import rig
from rig.bench import Bench
from rig.emulator.emulated import emulated
from rig.wire.can.frames import Frame
from rig.wire.can.slcan import SlcanBus
from tests.closed_loop.test_wires import EQUAL, PLAN, bench_at

BLOCKS = {"shipped": 7, "1 kHz": 1}  # of one frame, on CAN FD and on classical CAN
PLAN_OF_ONE = PLAN.model_copy(update={"levels_v": (0.4,), "retries": 0})


def hand_over_later(monkeypatch: pytest.MonkeyPatch, every: int, by: int) -> list[Frame]:
    """Let the host's adapter hand one of ``every`` frames of samples over ``by`` frames later; return them as they come."""
    receive, waiting, number = SlcanBus.receive, deque[Frame](), count(1)
    late: list[Frame] = []

    def disordered(bus: SlcanBus, timeout_s: float) -> Frame | None:
        if waiting:
            return waiting.popleft()
        frame = receive(bus, timeout_s)
        if frame is None or frame.identifier < 0x300 or next(number) % every:
            return frame
        late.append(frame)
        waiting.extend(other for _ in range(by) if (other := receive(bus, 5.0)) is not None)
        waiting.append(frame)
        return waiting.popleft()

    monkeypatch.setattr(SlcanBus, "receive", disordered)
    monkeypatch.setattr("rig.loop.worker.spawn.supported", lambda: False)  # the loop runs here, where the bus is ours
    return late


def with_queue(bench: Bench, blocks: int) -> Bench:
    options = {**bench.driver.options, "queue_blocks": blocks}
    return bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})


@pytest.mark.slow
@pytest.mark.parametrize("rate", BLOCKS)
def test_neighbours_in_each_others_place_leave_the_point_as_it_is(monkeypatch, rate):
    bench = bench_at(rate).model_copy(update={"block": BLOCKS[rate]})
    with rig.run(PLAN_OF_ONE, bench=bench, seed=1) as run:
        (wanted,) = run.recording.points
    late = hand_over_later(monkeypatch, 47, 1)
    with (
        emulated(bench, "can", lockstep=True, seed=1, fd=rate == "shipped") as far,
        rig.run(PLAN_OF_ONE, bench=far, seed=1) as run,
    ):
        (point,), part = run.recording.points, run.recording.parts[-1]
    assert part.end["completed"]
    assert point["accepted"]
    assert point["lost_samples"] == 0
    for key, tolerance in EQUAL.items():
        assert point[key] == pytest.approx(wanted[key], rel=tolerance)
    counters = part.end["counters"]
    assert counters["lost_samples"] == counters["late_blocks"] == counters["repeated_frames"] == 0
    assert 0.8 * len(late) < counters["reordered_blocks"] == counters["out_of_order_frames"] <= len(late)
    remarks = [event["text"] for event in part.events if event["what"] == "remark"]
    assert remarks[-1].startswith(
        f"frames arrive out of order: {counters['out_of_order_frames']} frames after a later one"
    )


def test_blocks_that_come_too_late_to_be_put_in_order_are_lost_and_the_order_is_named(monkeypatch):
    bench = bench_at("shipped").model_copy(update={"block": BLOCKS["shipped"]})
    hand_over_later(monkeypatch, 15, 2)
    with (
        emulated(bench, "can", lockstep=True, seed=1, fd=True) as far,
        rig.run(PLAN_OF_ONE, bench=with_queue(far, 3), seed=1) as run,
    ):
        (point,), part = run.recording.points, run.recording.parts[-1]
    counters = part.end["counters"]
    assert counters["late_frames"] > 10
    assert counters["lost_samples"] == pytest.approx(7 * counters["late_frames"], abs=7)
    assert not point["accepted"]
    assert "samples were lost" in point["reason"]
    assert "frames arrive out of order: " in point["reason"]
    assert f"{counters['late_frames']} frames too late for their block" in part.events[-1]["text"]
