"""The first point measured again at the end: where it stands, what it tells, and that it is part of no result."""

import shutil

import numpy as np
import pytest

import rig
from rig.campaigns.plans import load_plan
from rig.measurements import backbone, frequency_responses
from rig.measurements.points_left_out import points_left_out
from rig.recording.reader import Recording
from rig.show.summary import summarise
from rig.show.tables import print_summary
from rig.tick.sequencer.layout import SegmentKind
from tests.recorded import recorded_at
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.campaigns.stepped_phase.test_plan import plan as stepped
from tests.rig.check.rewired import rewire, scaled

LEVELS = {"levels_v": (0.4, 0.8)}


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A complete recording of two levels, without repetition."""
    path = tmp_path_factory.mktemp("drift") / "run.h5"
    recorded_at(path, plan_with(**LEVELS), seed=1)
    return path


@pytest.mark.parametrize("plan", [plan_with(direction="up-down"), plan_with(repeats=2), stepped(direction="up-down")])
def test_it_is_the_first_target_once_more_behind_all_others(plan):
    targets = plan.targets()
    again = plan.model_copy(update={"repeat_first": True}).targets()
    assert again[:-1] == targets
    assert again[-1] == targets[0].model_copy(update={"number": len(targets), "repeats_first": True})


def test_a_stepped_phase_goes_back_to_its_start_as_if_for_another_level():
    plan = stepped(repeat_first=True, levels_n=[0.2])
    last = [s for s in plan.segments(5000.0) if s.point in (-1, 3)][-6:]
    assert [s.lag_deg for s in last] == [-120.0] * 6
    assert [s.kind for s in last[:3]] == [SegmentKind.RAMP, SegmentKind.START, SegmentKind.RAMP]


def test_of_a_rig_that_stays_as_it_is_nothing_has_drifted_and_the_backbone_is_that_of_the_levels(tmp_path):
    with rig.run(plan_with(**LEVELS, repeat_first=True), output=tmp_path / "run.h5", seed=1) as run:
        assert run.complete
        points = run.recording.latest
        assert [point.get("repeats_first", False) for point in points.values()] == [False, False, True]
        assert run.backbone().force_n.tolist() == [points[0]["force_n"], points[1]["force_n"]]
    drift = summarise(tmp_path / "run.h5")["drift"]
    assert (drift["first"], drift["again"]) == (0, 2)
    assert abs(drift["frequency"]) < 1e-5
    assert abs(drift["damping"]) < 5e-3
    assert abs(drift["amplitude"]) < 2e-3


def test_asked_for_later_it_is_measured_alone_and_tells_what_has_changed_since(begun, tmp_path, monkeypatch, capsys):
    path = shutil.copy(begun, tmp_path / "run.h5")
    rewire(monkeypatch, scaled("drive", 1.02))
    with rig.resume(path, plan=plan_with(**LEVELS, repeat_first=True)) as run:
        assert run.complete
        assert [point["number"] for point in run.recording.parts[1].points] == [2]
    summary = summarise(path)
    drift = summary["drift"]
    # A sensor that reads 2 % more: an amplitude of 1.02, a damping force v / a^2 of 1 / 1.02.
    assert drift["amplitude"] == pytest.approx(0.02, abs=3e-3)
    assert drift["damping"] == pytest.approx(1.0 / 1.02 - 1.0, abs=5e-3)
    assert abs(drift["frequency"]) < 2e-5
    print_summary(summary)
    assert "drift from the first point to the same again (point 3): frequency " in capsys.readouterr().out
    with rig.resume(path, plan=plan_with(**LEVELS)) as run:
        assert sorted(run.recording.former) == [2]
    assert summarise(path)["drift"] is None


def test_a_repetition_that_is_missing_is_left_out_of_nothing_but_the_drift(begun, tmp_path, monkeypatch):
    path = shutil.copy(begun, tmp_path / "run.h5")
    rewire(monkeypatch, lambda volts, bench: volts.__imul__(0.0))
    with rig.resume(path, plan=plan_with(**LEVELS, repeat_first=True)) as run:
        assert not run.complete
    with Recording(path) as recording:
        assert len(backbone(recording).points) == 2
        assert points_left_out(recording) == ()
    assert summarise(path)["drift"] is None


def test_a_stepped_phase_s_response_holds_every_lag_once(tmp_path):
    changes = {"repeat_first": True, "levels_n": (0.25,), "start_deg": -120.0, "stop_deg": -60.0, "step_deg": 30.0}
    plan = load_plan("magnet-beam/stepped-phase-fast").model_copy(update=changes)
    with rig.run(plan, output=tmp_path / "run.h5", seed=2) as run:
        assert run.complete
        (response,) = frequency_responses(run.recording)
    assert np.allclose(response.phase_lag_deg, [60.0, 90.0, 120.0], atol=1.0)
    drift = summarise(tmp_path / "run.h5")["drift"]
    assert abs(drift["frequency"]) < 1e-4
    assert abs(drift["amplitude"]) < 0.01
