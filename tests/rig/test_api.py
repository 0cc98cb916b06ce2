"""Recordings of runs that were given no file."""

import gc

import pytest

import rig
from tests.recorded import SHORT, recorded_run
from tests.rig.campaigns.running.test_runs import plan_with

PLAN = plan_with(levels_v=(0.4,), record_periods=4)


def test_a_recording_without_a_file_of_its_own_ends_with_its_run():
    run = rig.run(PLAN)
    path = run.recording.path
    assert path.exists()
    run.itself = run  # only the garbage collector ends it; a warning fails the test
    del run
    gc.collect()
    assert not path.parent.exists()


def test_closing_a_run_deletes_its_recording_once():
    with rig.run(PLAN) as run:
        path = run.recording.path
    assert not path.parent.exists()
    run.close()


def test_a_run_and_its_backbone_are_printed_as_what_they_are():
    with recorded_run("magnet-beam/backbone", **SHORT) as run:
        assert (
            str(run)
            == repr(run)
            == (f"<Run: backbone on magnet-beam, 2 points accepted, complete, {run.recording.path}>")
        )
        backbone = run.backbone()
        lines = str(backbone).splitlines()
        assert lines[2].split() == ["force", "N", "frequency", "Hz", "amplitude", "mm", "phase", "error", "deg"]
        assert [float(line.split()[1]) for line in lines[3:]] == pytest.approx(backbone.frequency_hz, abs=1e-4)
        assert backbone.to_pandas()["amplitude_m"].tolist() == backbone.amplitude_m.tolist()
