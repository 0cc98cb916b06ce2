"""Recordings of runs that were given no file."""

import gc

import rig
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
