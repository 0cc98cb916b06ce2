"""What is wrong from the first sample on ends a run at the start voltage, before the level rises."""

from dataclasses import replace

import numpy as np
import pytest

from rig.arming.run_options import RunOptions
from rig.campaigns.running.runner import _checked, run_plan
from rig.campaigns.running.start_judgement import StartJudgement
from rig.check.run import check
from rig.emulator.emulated import emulated
from rig.tick.layout import recorded_row
from tests.refused import refused
from tests.reliability.faults.plans import bench_for, plan_for
from tests.rig.check.rewired import Rewiring, column, rewire, scaled
from tests.rig.rigs import bench_with


def late(name: str, samples: int) -> Rewiring:
    """A sensor whose signal comes late."""
    past: list[np.ndarray] = []

    def rewiring(volts, bench):
        index = column(bench, name)
        past.append(volts[:, index].copy())
        told = np.concatenate([np.zeros(samples), *past])[-volts.shape[0] - samples :][: volts.shape[0]]
        volts[:, index] = told
        del past[: -2 - samples // volts.shape[0]]

    return rewiring


@pytest.fixture(scope="module")
def scale(tmp_path_factory):
    """What a check of the sound bench has measured."""
    return check(bench_for("m"), tmp_path_factory.mktemp("check") / "check.h5").scale


def run(tmp_path, levels, **options):
    recording = run_plan(plan_for(levels), bench_for(levels), tmp_path / "run.h5", RunOptions(seed=3, **options))
    with recording:
        return recording.parts[-1].end, np.abs(recording.parts[-1].rows("output_v")).max(), len(list(recording.points))


@pytest.mark.parametrize("levels", ["N logarithmic", "N linear", "m"])
def test_a_drive_sensor_10_ms_late_ends_the_run_at_the_start_voltage(tmp_path, monkeypatch, levels):
    rewire(monkeypatch, late("drive", 50))
    end, largest_v, points = run(tmp_path, levels)
    assert end["reason"] == "start_refused"
    assert end["text"].startswith("before the first level: channel drive: all others")
    assert "refused from 45 deg" in end["text"]
    assert largest_v < 1.05 * plan_for(levels).start_v
    assert points == 0


@pytest.mark.parametrize(
    ("channel", "factor", "levels"),
    [("drive", 0.1, "m"), ("force", 0.1, "N linear"), ("force", 10.0, "N linear"), ("force", 0.1, "N logarithmic")],
)
def test_a_sensor_of_another_scale_than_in_the_check_ends_the_run_at_the_start_voltage(
    tmp_path, monkeypatch, scale, channel, factor, levels
):
    rewire(monkeypatch, scaled(channel, factor))
    end, largest_v, points = run(tmp_path, levels, check=scale)
    assert f"channel {channel}: " in end["text"]
    assert largest_v < 1.05 * plan_for(levels).start_v
    assert points == 0


def test_half_of_the_scale_is_a_warning_of_every_point(tmp_path, monkeypatch, scale):
    rewire(monkeypatch, scaled("force", 2.0))
    with run_plan(plan_for("m"), bench_for("m"), tmp_path / "run.h5", RunOptions(seed=3, check=scale)) as recording:
        points = list(recording.points)
    assert len(points) == 3
    assert all(any("channel force: " in line for line in point["warnings"]) for point in points)


def test_levels_in_volts_are_judged_with_the_first_point_and_go_no_further(tmp_path, monkeypatch, scale):
    rewire(monkeypatch, scaled("force", 10.0))
    end, _, points = run(tmp_path, "V", check=scale)
    assert "channel force: " in end["text"]
    assert points < 3


@pytest.mark.parametrize("samples", [0, 1, 50, 206, 2000])
@pytest.mark.parametrize("reads", [0.0, np.nan])
def test_rows_that_hold_no_vibration_prove_nothing(scale, samples, reads):
    bench = bench_for("m")
    rows = np.zeros(samples, recorded_row(len(bench.channels)))
    rows["theta_rad"] = np.mod(2.0 * np.pi * 24.37 / bench.sample_rate_hz * np.arange(samples), 2.0 * np.pi)
    rows["inputs"] = reads
    assert StartJudgement(bench, plan_for("m"), scale).refusal_of_rows(rows) == ""


def test_a_sound_rig_goes_on_as_if_nothing_had_been_judged(tmp_path, scale):
    with_check, without = (run(tmp_path / name, "m", **options) for name, options in _both(tmp_path, scale))
    assert with_check[0]["reason"] == without[0]["reason"] == "completed"
    assert with_check[0]["loop"]["samples"] == without[0]["loop"]["samples"]
    assert with_check[1:] == without[1:]


def _both(tmp_path, scale):
    for name, options in (("with", {"check": scale}), ("without", {})):
        (tmp_path / name).mkdir()
        yield name, options


def test_the_command_takes_the_recording_of_a_check(tmp_path, command):
    path = tmp_path / "check.h5"
    check(bench_with({}, "magnet-beam"), path, RunOptions(seed=3))
    command("run", "magnet-beam/backbone-short", "-o", tmp_path / "run.h5", "--check", path).succeeded()
    ended = command("run", "friction-beam/backbone-short", "-o", tmp_path / "other.h5", "--check", path)
    assert "other channels" in ended.err


@pytest.mark.parametrize("scaled_by", [1.0, 0.1])
def test_in_lockstep_behind_a_wire_the_same_rows_come_as_in_this_process(tmp_path, scaled_by, scale, monkeypatch):
    bench, plan = bench_for("m"), plan_for("m")
    options = {**bench.driver.options, "queue_blocks": 1}
    near = bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})
    wrong = (
        scale if scaled_by == 1.0 else replace(scale, acceleration_per_newton=scaled_by * scale.acceleration_per_newton)
    )
    found = []
    with emulated(bench, "serial") as far:
        for number, one in enumerate((near, far)):
            with run_plan(plan, one, tmp_path / f"{number}.h5", RunOptions(check=wrong)) as recording:
                part = recording.parts[-1]
                found.append((part.end["reason"], part.rows("command_v")))
    assert found[0][0] == found[1][0] == ("completed" if scaled_by == 1.0 else "start_refused")
    whole = min(rows.size for _, rows in found) if scaled_by == 1.0 else 5000  # a refusal comes when it is ready
    np.testing.assert_allclose(found[0][1][:whole], found[1][1][:whole], rtol=1e-6)
    if scaled_by == 1.0:
        assert abs(found[0][1].size - found[1][1].size) <= 2 * bench.block


@pytest.mark.parametrize(
    "told", [None, 1.0, "x", {"at": ""}, {"at": "", "frequency_hz": float("nan")}, {"no": "field"}]
)
def test_what_a_recording_holds_in_place_of_a_scale_is_no_scale(told):
    assert _checked({"checked": told}) is None


def test_a_judgement_that_fails_ends_the_run_and_leaves_no_loop_waiting(tmp_path, monkeypatch):
    def fail(self, rows):
        raise RuntimeError("for a test")

    monkeypatch.setattr(StartJudgement, "refusal_of_rows", fail)
    with emulated(bench_for("m"), "serial") as far, refused(RuntimeError, "for-a-test"):
        run_plan(plan_for("m"), far, tmp_path / "run.h5", RunOptions())


@pytest.mark.parametrize("with_check", [True, False])
def test_a_start_that_cannot_be_compared_with_the_check_says_so_and_the_first_point_is(
    tmp_path, monkeypatch, scale, with_check
):
    rewire(monkeypatch, scaled("force", 2.0))
    monkeypatch.setattr(StartJudgement, "refusal_of_rows", lambda judgement, rows: "")  # none can be evaluated
    options = RunOptions(seed=3, check=scale if with_check else None)
    with run_plan(plan_for("m"), bench_for("m"), tmp_path / "run.h5", options) as recording:
        points = list(recording.points)
        remarks = [event["text"] for event in recording.parts[0].events if event["what"] == "remark"]
    assert len(points) == 3
    assert sum("not steady enough to compare" in remark for remark in remarks) == with_check
    assert all(any("channel force: " in line for line in point["warnings"]) for point in points) is with_check
