"""A recording that goes on by a changed plan: what is measured, what is kept, what counts, and what a kill leaves."""

import json
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import rig
from controller import preset
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.multisine.plan import MultisinePlan
from rig.errors import ConfigurationError
from rig.measurements import point_rows, spectra
from rig.measurements.points_left_out import points_left_out
from rig.recording.blocks import BlockKind
from rig.recording.journal import journal_path
from rig.recording.journal_blocks import JournalBlocks
from rig.recording.reader import Recording
from rig.show.summary import summarise
from rig.tick.sequencer.segments import SettleRule
from tests.forking import FORKED
from tests.recorded import recorded_at
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with, running

ROOT = Path(__file__).parents[4]
FIRST = plan_with(levels_v=(0.4, 0.8))
SECOND = plan_with(levels_v=(0.3, 0.4, 0.6), controller=preset("magnet-beam").model_dump() | {"k1": 1.5})


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A complete recording by the first plan."""
    output = tmp_path_factory.mktemp("begun") / "run.h5"
    recorded_at(output, FIRST, seed=3)
    return output


@pytest.fixture
def output(begun, tmp_path):
    return Path(shutil.copy(begun, tmp_path / "run.h5"))


@pytest.fixture(scope="module")
def under_way(begun, tmp_path_factory):
    """The same with its second part still in the journal, and the points by the level."""
    output = Path(shutil.copy(begun, tmp_path_factory.mktemp("under_way") / "run.h5"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rig.campaigns.running.runner.finalise", lambda *_: None)
        with rig.resume(output, plan=SECOND) as run:
            assert run.complete
    return output


def test_points_that_are_asked_for_again_stay_and_only_the_others_are_measured(output):
    with Recording(output) as recording:
        before = {point["level"]: point for point in recording.points}
    with rig.resume(output, plan=SECOND) as run:
        recording = run.recording
        assert run.complete
        assert [point["level"] for point in recording.latest.values()] == [0.3, 0.4, 0.6]
        assert [point["part"] for point in recording.latest.values()] == [1, 0, 1]
        assert recording.latest[0] == before[0.4]
        assert [point["level"] for point in recording.parts[1].points] == [0.3, 0.6]
        assert list(recording.former.values()) == [before[0.8]]
        assert len({point["number"] for point in recording.points}) == 4
        measured = run.backbone()
        np.testing.assert_array_equal(np.diff(measured.force_n) > 0.0, True)
        np.testing.assert_allclose(measured.phase_error_deg, 0.0, atol=0.3)
        for point in recording.points:
            rows = point_rows(recording, point["number"])
            assert abs(np.abs(rows["command_v"]).mean() - point["level"]) < 1e-3
    assert not journal_path(output).exists()


def test_the_file_holds_both_plans_and_the_one_in_force_is_the_last(output):
    rig.resume(output, plan=SECOND, seed=11).close()
    with Recording(output) as recording:
        assert BackbonePlan.model_validate(recording.configuration["plan"]) == SECOND
        assert BackbonePlan.model_validate(recording.plans[0].plan) == FIRST
        assert recording.parts[1].information["seed"] == 11
        assert recording.parts[0].information["seed"] == 3
    with h5py.File(output) as file:
        assert json.loads(file["configuration"][()])["plan"]["levels_v"] == [0.4, 0.8]
        said = json.loads(file["parts/1/information"][()])
        assert said["plan"]["levels_v"] == [0.3, 0.4, 0.6]
        assert said["numbers"] == [2, 0, 3]
        assert file["parts/1/points/number"][()].tolist() == [2, 3]
    summary = summarise(output)
    assert summary["complete"]
    assert summary["points_planned"] == 3
    assert [point["level"] for point in summary["former_points"]] == [0.8]
    assert [part["changed"] for part in summary["parts"]] == [[], ["controller.k1", "levels_v"]]


def test_seeds_of_parts_differ_unless_they_are_given(output):
    rig.resume(output, plan=plan_with(levels_v=(0.4, 0.5))).close()
    rig.resume(output, plan=plan_with(levels_v=(0.5, 0.6))).close()
    with Recording(output) as recording:
        assert len({part.information["seed"] for part in recording.parts}) == 3
    with refused(ConfigurationError, field="seed", value=-1, allowed="0 to 2**63 - 1"):
        rig.resume(output, seed=-1)


def test_a_plan_that_asks_for_less_completes_without_moving_and_one_that_asks_again_finds_its_points(output):
    with rig.resume(output, plan=plan_with(levels_v=(0.8,))) as run:
        assert run.complete
        assert run.recording.parts[1].n_rows == 0
        assert run.backbone().points[0].amplitude_m == run.recording.latest[1]["amplitude_m"]
        assert summarise(output)["parts"][1]["ended"] == "nothing was left to measure"
    with rig.resume(output, plan=FIRST) as run:
        assert run.complete
        assert [part.n_rows > 0 for part in run.recording.parts] == [True, False, False]
        assert len(run.backbone().points) == 2
    before = output.read_bytes()
    rig.resume(output, plan=FIRST).close()
    assert output.read_bytes() == before


def test_points_that_failed_are_measured_by_the_changed_plan_under_the_same_number(tmp_path):
    patient = plan_with(levels_v=(0.4, 0.8))
    impossible = SettleRule(amplitude=1e-7, longest_periods=60).model_dump()
    with rig.run(plan_with(levels_v=(0.4, 0.8), settle=impossible), output=tmp_path / "run.h5") as run:
        assert not any(point["accepted"] for point in run.recording.points)
    with rig.resume(tmp_path / "run.h5", plan=patient) as run:
        assert run.complete
        assert list(run.recording.latest) == [0, 1]
        assert run.recording.former == {}
        assert [point["number"] for point in run.recording.points] == [0, 1, 0, 1]
        assert points_left_out(run.recording) == ()


def test_a_campaign_that_trips_goes_on_after_a_change_and_a_model_knows_what_is_left_out(tmp_path):
    stopping = plan_with(
        levels_v=(0.4, 0.8), on_failure="stop", settle=SettleRule(amplitude=1e-7, longest_periods=60).model_dump()
    )
    with rig.run(stopping, output=tmp_path / "run.h5") as run:
        assert not run.complete
    with rig.resume(tmp_path / "run.h5", plan=plan_with(levels_v=(0.6, 0.8))) as run:
        assert run.complete
        assert [point["level"] for point in run.recording.latest.values()] == [0.6, 0.8]
        assert list(run.recording.former) == [0]
        assert points_left_out(run.recording) == ()
    again = stopping.model_copy(update={"levels_v": (0.6, 0.9)})
    with rig.resume(tmp_path / "run.h5", plan=again) as run:
        assert not run.complete
        (note,) = points_left_out(run.recording)
    assert "1 of 2 points" in note
    assert "1 of 1 at 0.9 V" in note


def test_realisations_of_different_lengths_make_one_spectrum(tmp_path):
    table = {
        "bench": "magnet-beam",
        "levels_rms_v": (0.2,),
        "lowest_hz": 22.0,
        "highest_hz": 28.0,
        "resolution_hz": 0.5,
        "realisations": 1,
        "periods": 4,
    }
    rig.run(MultisinePlan(**table), output=tmp_path / "run.h5").close()
    longer = MultisinePlan(**(table | {"realisations": 2, "periods": 6}))
    with rig.resume(tmp_path / "run.h5", plan=longer) as run:
        assert run.complete
        both = spectra(run.recording)[0.2]
    assert both.spectra.shape[:2] == (2, 4)
    with rig.run(MultisinePlan(**(table | {"realisations": 2}))) as run:
        whole = spectra(run.recording)[0.2]
    np.testing.assert_allclose(both.rms("force"), whole.rms("force"), rtol=0.01)


def test_the_journal_of_a_killed_second_part_is_read_wherever_it_ends_and_knows_its_plan(under_way, tmp_path):
    whole = journal_path(under_way).read_bytes()
    blocks = [(block.kind, block.stop) for block in JournalBlocks(journal_path(under_way))]
    begins = next(stop for kind, stop in blocks if kind is BlockKind.PART)
    output = Path(shutil.copy(under_way, tmp_path / "run.h5"))
    points_at = [stop for kind, stop in blocks if kind is BlockKind.POINT]
    cuts = {begins - 1, begins, *(stop + offset for stop in points_at for offset in (-1, 0)), len(whole) - 1}
    for cut in sorted(cuts):
        journal_path(output).write_bytes(whole[:cut])
        with Recording(output) as recording:
            in_force = BackbonePlan.model_validate(recording.configuration["plan"])
            assert in_force == (FIRST if cut < begins else SECOND)
            done = sum(stop <= cut for stop in points_at)
            known = [0.4, 0.8] if cut < begins else [[0.4], [0.3, 0.4], [0.3, 0.4, 0.6]][done]
            assert [point["level"] for point in recording.latest.values()] == known
            assert recording.complete == (cut < begins)


@pytest.mark.parametrize("points_left", [0, 1, 2])
def test_a_kill_in_the_second_part_is_resumed_by_the_changed_plan(under_way, tmp_path, points_left):
    whole = journal_path(under_way).read_bytes()
    stops = [block.stop for block in JournalBlocks(journal_path(under_way)) if block.kind is BlockKind.POINT]
    output = Path(shutil.copy(under_way, tmp_path / "run.h5"))
    journal_path(output).write_bytes(whole[: [*stops, len(whole)][2 - points_left] - 5])
    with rig.resume(output) as run:
        assert run.complete
        assert [point["level"] for point in run.recording.latest.values()] == [0.3, 0.4, 0.6]
        assert len(run.recording.plans) == 2
        assert len(run.recording.parts) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


CHILD = """
import sys
import rig
from tests.rig.campaigns.running.test_change_of_plan import SECOND
rig.resume(sys.argv[1], plan=SECOND, realtime=True)
"""


def test_kill_9_in_the_second_part_loses_no_point_of_either(output):
    with running(CHILD, output, 3) as child:
        child.kill()
        assert child.wait() == -signal.SIGKILL
    with Recording(output) as recording:
        assert [point["level"] for point in recording.latest.values()] == [0.3, 0.4]
        assert not recording.complete
    third = SECOND.model_copy(update={"levels_v": (0.3, 0.4, 0.8)})  # changed once more, before the rest is measured
    with rig.resume(output, plan=third) as run:
        assert run.complete
        assert [point["part"] for point in run.recording.latest.values()] == [1, 0, 0]
        assert len(run.backbone().points) == 3


FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
import rig, rig.errors
from tests.rig.campaigns.running.test_change_of_plan import SECOND
sys.dont_write_bytecode = True
rig.run(SECOND).close()
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    rig.resume(sys.argv[1], plan=SECOND)
except rig.errors.RecordingError as error:
    print(error)
    sys.exit(7)
"""


@pytest.mark.parametrize("room", [5_000, 1_200_000])
def test_a_full_disk_in_the_second_part_keeps_the_first_and_what_fitted(output, room):
    before = output.read_bytes()
    command = [sys.executable, "-c", FORKED + FULL, str(output), str(room)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 7, done.stderr
    assert len(done.stdout.strip().splitlines()) == 1
    assert output.read_bytes() == before
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != room
    with rig.resume(output, plan=SECOND) as run:
        assert run.complete
        assert len(run.backbone().points) == 3


def as_of_schema_1(monkeypatch):
    monkeypatch.setattr("rig.recording.header.SCHEMA", 1)
    monkeypatch.setattr("rig.recording.layout.SCHEMA", 1)


@pytest.mark.parametrize("finished", [True, False])
def test_a_recording_of_schema_1_goes_on_with_and_without_a_change(tmp_path, monkeypatch, finished):
    output = tmp_path / "run.h5"
    with monkeypatch.context() as patch:
        as_of_schema_1(patch)
        if not finished:
            patch.setattr("rig.campaigns.running.runner.finalise", lambda *_: None)
        rig.run(FIRST, output=output).close()
        assert output.exists() == finished
    if not finished:
        journal = journal_path(output)
        assert JournalBlocks(journal).header.schema == 1
        journal.write_bytes(journal.read_bytes()[:-9])  # killed while its end was written
    with rig.resume(output) as run:
        assert run.complete
    with rig.resume(output, plan=SECOND) as run:
        assert run.complete
        assert [point["part"] for point in run.recording.latest.values()][1] == 0
    with h5py.File(output) as file:
        assert file.attrs["schema"] == 3


def test_the_journal_of_schema_1_takes_no_change_of_plan(tmp_path, monkeypatch):
    output = tmp_path / "run.h5"
    with monkeypatch.context() as patch:
        as_of_schema_1(patch)
        patch.setattr("rig.campaigns.running.runner.finalise", lambda *_: None)
        rig.run(FIRST, output=output).close()
    with monkeypatch.context() as patch:
        patch.setattr("rig.campaigns.running.runner.finalise", lambda *_: None)
        rig.resume(output, plan=SECOND).close()
    assert JournalBlocks(journal_path(output)).header.schema == 3
    with Recording(output) as recording:
        assert len(recording.parts) == 2
        assert recording.complete


def _toml(text: str) -> str:
    return (
        f'kind = "backbone"\nbench = "magnet-beam"\n{text}\nrecord_periods = 20\n[controller]\nlow_pass_rad_s = 6.283\n'
        "k1 = 2.0\nk2 = 6.283\ncentre_frequency_hz = 24.0\nfrequency_window_hz = [21.9, 26.8]\n"
    )


@pytest.mark.parametrize(
    ("option", "status", "named"),
    [
        ("--plan magnet-beam/sweep-1", 1, "kind = 'sweep'; allowed: 'backbone', the kind of run.h5"),
        ("--plan friction-beam/backbone", 1, "bench = 'friction-beam'"),
        ("--plan magnet-beam/nosuch", 1, "there is no such plan"),
        (
            "--plan unknown.toml",
            1,
            "unknown.toml: levels_w: unknown key, did you mean levels_m or levels_n or levels_v?",
        ),
        ("--plan newtons.toml", 1, "newtons.toml: levels in N: allowed are levels in V"),
        ("--plan missing.toml", 1, "missing.toml: there is no such file"),
        ("--seed -1", 2, "--seed"),
    ],
)
def test_a_wrong_change_is_answered_in_one_line_and_leaves_the_file(command, output, option, status, named):
    Path("unknown.toml").write_text(_toml("levels_w = [0.4]"))
    Path("newtons.toml").write_text(_toml("levels_n = [0.4]"))
    before = output.read_bytes()
    code, out, err = command(f"resume run.h5 {option}")
    assert (code, out) == (status, "")
    assert len(err.strip().splitlines()) == 1
    assert named in err
    assert output.read_bytes() == before


def test_the_command_measures_what_is_new_and_show_tells_what_was_changed(command, output):
    Path("more.toml").write_text(_toml("levels_v = [0.4, 0.5]"))
    code, out, err = command("resume run.h5 --plan more.toml --seed 5")
    assert code == 0, err
    assert "2 of 2 points accepted" in out
    lines = [line.split() for line in err.splitlines()]
    assert [words[2:4] for words in lines] == [["0.5", "V"]]
    _, shown, _ = command("show run.h5")
    assert "not used: 1" in shown
    changed = "controller.frequency_window_hz, controller.k2, controller.low_pass_rad_s, levels_v"
    assert f"changed in the plan: {changed}" in shown


def test_an_unfinished_run_says_how_to_go_on(command):
    Path("hasty.toml").write_text(_toml("levels_v = [0.4]") + "[settle]\namplitude = 1e-7\nlongest_periods = 60\n")
    code, out, _ = command("run hasty.toml -o run.h5")
    assert code == 1
    assert "`rig resume run.h5` measures the rest, with --plan PLAN.toml by a changed plan" in out
