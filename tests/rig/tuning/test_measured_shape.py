"""A tuned plan is evaluated with the mode shape that was measured, whatever the bench believes."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.bench import Bench
from rig.campaigns.evaluation.recorded import points_of, recorded_drive_shape
from rig.campaigns.plans import plan_from
from rig.recording.reader import Recording
from rig.results.files import load
from rig.show.summary import summarise_recording
from rig.tuning import tune
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.rig.rigs import bench_with
from tests.rig.tuning.tuned import tuned_once

WRONG = 1.3


def wrong_bench() -> Bench:
    return bench_with({"specimen": {"drive_mode_shape": 0.908466 * WRONG}})


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """As of a test of its own: what a rig answers does not depend on the mode shape that its bench believes."""
    test = tuned_once("magnet-beam").test
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rig.tuning.tuning.measure", lambda *_: test)
        return tune(wrong_bench(), tmp_path_factory.mktemp("wrong") / "test.h5")


def few_levels(tuned, **changes):
    """The tuned plan with two of its levels, for time."""
    levels = {"levels_m": [tuned.plan.levels_m[3], tuned.plan.levels_m[5]], "start_v": tuned.levels.needed_v[3]}
    table = tomllib.loads(tuned.plan_toml) | levels | changes
    return plan_from(table, "tuned plan")


@pytest.fixture(scope="module")
def run(tuned, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "backbone.h5"
    rig.run(few_levels(tuned), bench=tuned.bench, output=path).close()
    return path


def truth(points):
    """Damping by harmonic balance at the forces of points, or of a model."""
    forces = points.force_n if hasattr(points, "force_n") else [point["force_n"] for point in points]
    virtual = VirtualRig.shipped("magnet-beam")
    curves = [phase_resonance_backbone(virtual, forces_n=np.geomspace(0.2 * force, force, 5)) for force in forces]
    return np.array([curve.damping_ratio[-1] for curve in curves])


def test_a_wrong_mode_shape_of_the_bench_is_measured_and_said(tuned):
    true = VirtualRig.shipped("magnet-beam").drive_shape(24.37)
    assert abs(tuned.plant.drive_shape - true) < 1.96 * tuned.plant.drive_shape_std < 0.01 * true
    (note,) = (note for note in tuned.notes if "drive_mode_shape" in note)
    assert "1.30 times the measured" in note
    assert "the plan uses the measured one" in note
    assert tuned.plan.plant.drive_shape_std == tuned.plant.drive_shape_std


def test_damping_is_that_of_harmonic_balance_within_its_interval(tuned, run):
    with Recording(run) as recording:
        summary = summarise_recording(recording)
    points = summary["points"]
    assert all(point["accepted"] for point in points)
    true = truth(points)
    found = np.array([point["damping_ratio"] for point in points])
    assert found == pytest.approx(true, rel=0.02)
    bound = np.array([1.96 * point["damping_ratio_std"] for point in points])
    assert np.all(np.abs(found - true) < bound)
    relative = tuned.plant.drive_shape_std / tuned.plant.drive_shape
    of_the_shape = 1.96 * 2.0 * relative * found
    assert bound[1:] == pytest.approx(of_the_shape[1:], rel=0.2)  # noise adds little
    assert bound[0] > of_the_shape[0]  # where the force is some steps of its converter, rounding adds much
    assert {point["drive_mode_shape"] for point in points} == {tuned.plant.drive_shape}


def test_the_model_names_its_mode_shape_with_that_of_the_bench_beside_it(tuned, run, tmp_path, command):
    said = command("identify", run, "-o", "mode.h5").succeeded().out
    assert "1.18101, is 1.30 times" in said
    mode = load(tmp_path / "mode.h5")
    assert (mode.drive_mode_shape, mode.drive_mode_shape_std) == (tuned.plant.drive_shape, tuned.plant.drive_shape_std)
    assert mode.damping_ratio == pytest.approx(truth(mode), rel=0.02)
    low, high = mode.interval("damping_ratio").T
    assert np.all((low < truth(mode)) & (truth(mode) < high))
    of_the_shape = 2.0 * mode.damping_ratio * tuned.plant.drive_shape_std / tuned.plant.drive_shape
    assert mode.systematic("damping_ratio")[1:] == pytest.approx(of_the_shape[1:], rel=0.1)
    assert mode.systematic("damping_ratio")[0] > of_the_shape[0]  # rounding of the smallest force besides
    assert "mode shape at the drive point: 0.90" in command("show", run).succeeded().out


def test_without_the_plant_damping_goes_with_the_bench_as_before(tuned, run, tmp_path):
    table = tomllib.loads(tuned.plan_toml)
    del table["plant"]
    path = tmp_path / "without.h5"
    rig.run(plan_from(table | {"levels_m": table["levels_m"][3:4]}, "plan"), bench=tuned.bench, output=path).close()
    with Recording(path) as recording:
        (point,) = recording.latest.values()
        assert "drive_mode_shape" not in point
        assert "damping_ratio_std" not in point
        assert summarise_recording(recording)["drive_mode_shape"]["source"] == "of the bench magnet-beam"
    assert point["damping_ratio"] == pytest.approx(WRONG**2 * truth([point])[0], rel=0.02)


def test_a_resumed_plan_with_another_shape_leaves_points_as_they_were_and_gives_the_model_its_own(tuned, tmp_path):
    path = tmp_path / "resumed.h5"
    first, second = tuned.plan.levels_m[3:5]
    table = tomllib.loads(tuned.plan_toml)
    other = table["plant"] | {"drive_shape": 1.01 * table["plant"]["drive_shape"], "drive_shape_std": 0.01}
    rig.run(few_levels(tuned, levels_m=[first]), bench=tuned.bench, output=path).close()
    with Recording(path) as recording:
        before = recording.latest[0]
    plan = few_levels(tuned, levels_m=[first, second], plant=other)
    with rig.resume(path, plan=plan) as run:
        mode = nonlinear_mode(run.backbone())
        summary = summarise_recording(run.recording)
    kept, added = summary["points"]
    assert kept["damping_ratio"] == before["damping_ratio"]
    assert kept["drive_mode_shape"] == tuned.plant.drive_shape
    assert added["drive_mode_shape"] == other["drive_shape"]
    assert summary["drive_mode_shape"]["others"] == [0]
    assert mode.drive_mode_shape == other["drive_shape"]
    assert mode.damping_ratio == pytest.approx([1.01**2 * kept["damping_ratio"], added["damping_ratio"]], rel=1e-6)


def test_a_bench_without_a_mode_shape_has_damping_by_a_plan_with_a_plant(tuned, tmp_path):
    bench = bench_with({"specimen": {"drive_mode_shape": None}})
    with rig.run(few_levels(tuned, levels_m=[tuned.plan.levels_m[3]]), bench=bench, output=tmp_path / "run.h5") as run:
        (point,) = run.recording.latest.values()
    assert point["damping_ratio"] == pytest.approx(truth([point])[0], rel=0.02)


def test_a_recording_of_a_version_that_took_the_bench_reads_as_it_did(tuned, run):
    with Recording(run) as recording:
        points = points_of(recording)
        assert recorded_drive_shape(recording, points).value == tuned.plant.drive_shape
        earlier = [replace(one, modal=replace(one.modal, drive_mode_shape=None)) for one in points]
        assert recorded_drive_shape(recording, earlier).value == tuned.bench.specimen.drive_mode_shape
