"""Sensors that fail in a way that trips nothing: what they read is told from data by what else is known."""

from functools import partial
from weakref import WeakKeyDictionary

import numpy as np
import pytest

import rig
from controller import preset
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.drivers.virtual.driver import VirtualDAQ
from rig.loop.loop import Loop
from tests.rig.rigs import bench_with

FORCE, DRIVE, BESIDE, TIP = range(4)
NOISE_V = 2e-5
PLAN = BackbonePlan.model_validate(
    {
        "bench": "magnet-beam",
        "controller": preset("magnet-beam").model_dump(),
        "levels_v": (0.4, 0.8, 1.2),
        "record_periods": 20,
    }
)


def bench(*, shapes=True):
    """The magnet beam, with or without what it knows of mode shapes of responses."""
    channels = [channel.model_dump() for channel in bench_with().channels]
    for channel in channels[2:]:
        channel["mode_shape"] = channel["mode_shape"] if shapes else None
    return bench_with({"channels": channels, "block": 10})


@pytest.fixture(scope="module")
def second_begins():
    """Sample of the record of the plan's second point."""
    with rig.run(PLAN, bench=bench(), seed=1) as run:
        assert run.complete
        return run.recording.points[1]["first_sample"]


def spoil(monkeypatch, after, change):
    """From sample ``after`` on, ``change(volts, channel noise)`` has its way with what every rig reads."""
    exchange, noise, samples = VirtualDAQ._exchange, np.random.default_rng(1), WeakKeyDictionary()

    def spoiled(self, voltages, inputs):
        exchange(self, voltages, inputs)
        samples[self] = samples.get(self, 0) + len(inputs)
        if samples[self] > after:
            change(inputs, NOISE_V * noise.normal(size=len(inputs)))

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", spoiled)


def _dead(inputs, noise):
    inputs[:, TIP] = noise


def _dead_beside(inputs, noise):
    inputs[:, BESIDE] = noise


def _tenth_of_the_drive(inputs, noise):
    inputs[:, DRIVE] *= 0.1


def _tenth_of_the_force(inputs, noise):
    inputs[:, FORCE] *= 0.1


def _reversed_tip(inputs, noise):
    inputs[:, TIP] *= -1.0


@pytest.mark.parametrize("shapes", [True, False])
@pytest.mark.parametrize(
    ("change", "channel"),
    [
        (_dead, "acc_magnet"),
        (_tenth_of_the_drive, "drive"),
        (_tenth_of_the_force, "force"),
    ],
)
def test_a_sensor_that_fails_between_two_points_is_named_and_no_further_point_is_accepted(
    monkeypatch, second_begins, change, channel, shapes
):
    spoil(monkeypatch, second_begins - 600, change)
    with rig.run(PLAN, bench=bench(shapes=shapes), seed=1) as run:
        points = run.recording.points
        assert [point["accepted"] for point in points] == [True, False, False], [p["reason"] for p in points]
        assert all(point["reason"].startswith(f"channel {channel}") for point in points[1:])
        last = points[-1]
        assert last["quality"] == "implausible"
        assert last["misfit"] > 4.0
        assert "refused from a factor 4" in last["reason"]


@pytest.mark.parametrize("change", [_dead, _reversed_tip])
def test_a_response_that_was_wrong_from_the_first_sample_on_is_told_by_the_mode_shapes_alone(monkeypatch, change):
    spoil(monkeypatch, 0, change)
    for shapes in (True, False):
        with rig.run(PLAN.model_copy(update={"levels_v": (0.4,)}), bench=bench(shapes=shapes), seed=1) as run:
            assert run.complete is not shapes
            assert ("polarity" in run.recording.points[0]["reason"]) is (shapes and change is _reversed_tip)


@pytest.mark.parametrize("before_the_end", [1500, 2500])
def test_a_response_that_dies_within_a_record_spoils_the_point(monkeypatch, second_begins, before_the_end):
    spoil(monkeypatch, second_begins + 20 / 24.37 * 5000 - before_the_end, _dead)
    with rig.run(PLAN.model_copy(update={"levels_v": (0.4, 0.8)}), bench=bench(), seed=1) as run:
        good, bad = run.recording.points
        assert good["accepted"]
        assert not bad["accepted"]
        assert "channel acc_magnet" in bad["reason"]


def test_a_response_that_dies_in_a_stepped_sine_is_noticed_off_resonance_too(monkeypatch):
    plan = SteppedSinePlan.model_validate(
        {"bench": "magnet-beam", "levels_v": (0.4,), "frequencies_hz": (23.6, 23.8, 24.0, 25.0), "record_periods": 20}
    )
    with rig.run(plan, bench=bench(), seed=1) as run:
        assert run.complete
        assert not any(point["warnings"] for point in run.recording.points)
        begins = run.recording.points[2]["first_sample"]
    spoil(monkeypatch, begins - 600, _dead)
    with rig.run(plan, bench=bench(), seed=1) as run:
        assert [point["accepted"] for point in run.recording.points] == [True, True, False, False]


def test_a_response_that_dies_between_realisations_of_a_multisine_is_noticed(monkeypatch):
    plan = MultisinePlan.model_validate(
        {
            "bench": "magnet-beam",
            "levels_rms_v": (0.1,),
            "lowest_hz": 20.0,
            "highest_hz": 40.0,
            "resolution_hz": 1.0,
            "realisations": 3,
        }
    )
    with rig.run(plan, bench=bench(), seed=1) as run:
        assert run.complete
        begins = run.recording.points[1]["first_sample"]
    spoil(monkeypatch, begins - 10, _dead)
    with rig.run(plan, bench=bench(), seed=1) as run:
        points = run.recording.points
        assert [point["accepted"] for point in points] == [True, False, False]
        assert points[1]["reason"].startswith("channel acc_magnet has")


@pytest.mark.slow
def test_a_response_that_dies_between_the_two_ways_of_a_continuous_backbone_is_noticed(monkeypatch):
    friction = bench_with({"block": 10}, "friction-beam")
    with rig.run("friction-beam/continuous-backbone", bench=friction, seed=1) as run:
        points = run.recording.points
        assert run.complete
        assert max(point["misfit"] for point in points) < 1.5
        half = (points[0]["first_sample"] + points[0]["end_sample"]) // 2
    spoil(monkeypatch, half, _dead_beside)
    with rig.run("friction-beam/continuous-backbone", bench=friction, seed=1) as run:
        reasons = [point["reason"] for point in run.recording.points]
    told = [r for r in reasons if r.startswith("channel acc_left") and "by the other way past the level" in r]
    assert len(told) >= len(reasons) - 3


def test_a_force_sensor_that_fails_is_not_taken_for_a_damping_that_rises_with_the_level(monkeypatch):
    plan = "friction-beam/backbone"
    friction = bench_with({"block": 10}, "friction-beam")
    with rig.run(plan, bench=friction, seed=1) as run:
        begins = run.recording.points[5]["first_sample"]
    spoil(monkeypatch, begins - 600, _tenth_of_the_force)
    with rig.run(plan, bench=friction, seed=1) as run:
        accepted = [point["accepted"] for point in run.recording.points]
    assert accepted == [True] * 5 + [False] * (len(accepted) - 5)
