"""A run is compared with what was foreseen, and a bench may ask for that before it is armed."""

from dataclasses import replace

import pytest

import rig
from rig.arming.rehearsed import subject_digest
from rig.arming.run_options import RunOptions
from rig.bench.bench import Arming
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.running.runner import resume_run, run_plan
from rig.errors import NotArmed, RecordingError
from rig.recording.reader import Recording
from rig.rehearsal.forecast import compare
from rig.rehearsal.forecasting import forecast, rehearsed_in
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.show.summary import summarise
from rig.show.tables import print_summary
from tests.refused import refused
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import SHORT, magnet_beam
from tests.rig.rigs import bench_with


@pytest.fixture(scope="module")
def foreseeing():
    known = knowledge_of_the_magnet_beam(0.02)
    return rehearse(RehearsalRequest(plan=SHORT, bench=magnet_beam(), knowledge=known, draws=16))


def points_on(bench):
    with rig.run(SHORT, bench=bench) as run:
        return points_of(run.recording), run.recording.parts[-1].end


def test_the_rig_that_was_known_lies_within(foreseeing):
    found = compare(forecast(foreseeing), *points_on(magnet_beam()))
    assert not found.findings
    assert all(0.0 <= rank <= 1.0 for point in found.points for rank in point.rank.values())
    assert len(found.points[0].rank) == 5


def test_another_rig_is_a_finding(foreseeing):
    stiffer = bench_with(
        {"specimen": {"linear_frequency_hz": 25.6}}, deviation={"frequency": [0.05, 0.0, 0.0, 0.0], "damping": []}
    )
    found = compare(forecast(foreseeing), *points_on(stiffer))
    assert any("point 1: frequency_hz = 25." in text and "outside all draws" in text for text in found.findings)


def test_a_trip_that_no_draw_had_is_a_finding(foreseeing):
    tight = bench_with({"limits": {"displacement_m": 3e-4}})
    found = compare(forecast(foreseeing), *points_on(tight))
    assert found.findings[0].startswith("the run tripped (displacement above its limit")


def careful(**arming):
    return magnet_beam(arming=Arming(**arming))


def test_a_bench_that_asks_for_a_rehearsal_is_armed_by_one_alone(tmp_path, foreseeing):
    told = rehearsed_in(foreseeing, "r.h5")
    bench = careful(largest_trip_probability=0.3)
    with refused(NotArmed, "arms-only-what-was-rehearsed-with"):
        run_plan(SHORT, bench, tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())
    with run_plan(SHORT, bench, tmp_path / "run.h5", RunOptions(rehearsal=told)) as recording:
        assert recording.complete
        assert recording.parts[0].information["about"]["rehearsal"]["digest"] == foreseeing.digest
    with refused(NotArmed, "with-draws-up-to-allowed-is"):
        run_plan(SHORT, careful(largest_trip_probability=0.1), tmp_path / "other.h5", RunOptions(rehearsal=told))
    old = replace(told, finished="2020-01-01T00:00:00+00:00")
    with refused(NotArmed, "counts-for"):
        run_plan(SHORT, bench, tmp_path / "other.h5", RunOptions(rehearsal=old))


def test_a_rehearsal_of_something_else_arms_nothing(tmp_path, foreseeing):
    told = rehearsed_in(foreseeing, "r.h5")
    other = SHORT.model_copy(update={"levels_v": (0.4, 0.9)})
    for plan, bench in ((other, magnet_beam()), (SHORT, bench_with({"limits": {"force_n": 30.0}}))):
        with refused(NotArmed, "is-of-another-plan-or-another"):
            run_plan(plan, bench, tmp_path / "run.h5", RunOptions(rehearsal=told))


def test_who_overrides_is_recorded(tmp_path, monkeypatch):
    monkeypatch.setenv("VIBROLOCK_OPERATOR", "a person")
    options = RunOptions(override_rehearsal="the specimen is scrap")
    with run_plan(SHORT, careful(largest_trip_probability=0.02), tmp_path / "run.h5", options) as recording:
        overridden = recording.parts[0].information["about"]["rehearsal"]["overridden"]
    assert (overridden["why"], overridden["by"]) == ("the specimen is scrap", "a person")
    assert "arms only plans rehearsed" in overridden["against"]


def test_names_and_arming_change_no_digest():
    assert subject_digest(SHORT, magnet_beam()) == subject_digest(SHORT, careful(automated=True))
    assert subject_digest(SHORT, magnet_beam()) == subject_digest(SHORT, magnet_beam(name="another name"))
    assert subject_digest(SHORT, magnet_beam()) != subject_digest(SHORT, magnet_beam(block=2))


def test_a_recording_shows_its_rehearsal_and_resumes_with_it(tmp_path, foreseeing, capsys):
    told = rehearsed_in(foreseeing, "r.h5")
    bench = careful(largest_trip_probability=0.3)
    path = tmp_path / "run.h5"
    run_plan(SHORT, bench, path, RunOptions(rehearsal=told)).close()
    print_summary(summarise(path))
    shown = capsys.readouterr().out
    well = sum(draw.trial.completed for draw in foreseeing.draws) / len(foreseeing.draws)
    assert f"rehearsed: ends well {100.0 * well:.3g} %, trips 0 % (up to 19 %) of 16 draws; r.h5" in shown
    assert "within the forecast" in shown
    with resume_run(path) as recording:
        assert recording.complete
    with Recording(path) as recording:
        assert "foreseen" in recording.parts[0].information["about"]["rehearsal"]


def test_a_recording_that_holds_no_rehearsal_in_its_place_is_not_resumed_and_says_so_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    monkeypatch.setattr("rig.campaigns.running.runner.rehearsal_facts", lambda *_: {"digest": "x", "draws": "many"})
    run_plan(SHORT, magnet_beam(), path).close()
    more = SHORT.model_copy(update={"levels_v": (*SHORT.levels_v, 0.5)})
    with refused(RecordingError, "run-h-rehearsal-file-of-its"):
        resume_run(path, change=more)
