"""A loop that finds no lock at the start voltage never takes over a level, and the run says what to look for."""

import numpy as np
import pytest

import rig
from controller import LockState
from controller.kernels import LOCK
from rig.campaigns.plans import load_plan
from rig.tick.sequencer.judgement import CLAMPED_PERIODS, FAR_PERIODS, SETTLING, start_verdict
from rig.tick.sequencer.layout import Outcome
from tests.rig.rigs import bench_with


def _reversed(specimen, role):
    """The bench with the polarity of one sensor the wrong way round."""
    bench = bench_with(name=specimen)
    channels = [
        channel.model_copy(update={"sensitivity_v_per_unit": -channel.sensitivity_v_per_unit})
        if channel.role == role
        else channel
        for channel in bench.channels
    ]
    return bench.model_copy(update={"channels": tuple(channels)})


@pytest.mark.parametrize(
    ("plan", "role"),
    [
        ("magnet-beam/stepped-phase-fast", "force"),
        ("magnet-beam/stepped-phase-fast", "drive"),
        ("magnet-beam/response-controlled", "force"),
        ("friction-beam/stepped-phase-fast", "force"),
    ],
)
def test_with_a_reversed_sensor_the_run_ends_near_the_start_voltage_and_asks_for_the_polarity(plan, role):
    start_v = load_plan(plan).start_v
    with rig.run(plan, bench=_reversed(plan.split("/")[0], role)) as run:
        points, part = run.recording.points, run.recording.parts[0]
        highest_v = np.abs(part.rows("command_v")).max()
        end = part.end
    factor = 1.001 if plan.startswith("magnet") else 4.0  # there the window's end is reached on the way to the level
    assert highest_v < factor * start_v
    assert end["reason"] in ("no_lock", "no_lock_in_window")
    assert not end["tripped"]
    assert "no lock at the start voltage" in end["text"]
    assert "polarity" in end["text"]
    assert len(points) == len(load_plan(plan).targets())
    for point in points:
        assert not point["accepted"]
        assert point["quality"] in ("not-locked", "outside-window")
        assert point["reason"].startswith("no lock at the start voltage: ")
        assert "polarity reversed" in point["reason"]
    assert end["skipped"].startswith(f"{len(points)} of {len(points)} points skipped: ")


@pytest.mark.parametrize("role", ["force", "drive"])
def test_a_reversed_sensor_contradicts_a_known_plant_before_the_start_voltage_is_reached(role):
    plan = "magnet-beam/continuous-backbone"
    with rig.run(plan, bench=_reversed("magnet-beam", role)) as run:
        part = run.recording.parts[0]
        highest_v, end = np.abs(part.rows("command_v")).max(), part.end
    assert end["reason"] == "plant_contradicted"
    assert highest_v < load_plan(plan).start_v
    assert "polarity" in end["likely_cause"]


@pytest.mark.parametrize("role", ["force", "drive"])
def test_a_reversed_sensor_in_voltage_control_is_noticed_at_the_lowest_level(role):
    lowest_v = min(load_plan("magnet-beam/backbone").levels)
    with rig.run("magnet-beam/backbone", bench=_reversed("magnet-beam", role)) as run:
        part, points = run.recording.parts[0], run.recording.points
        highest_v, highest_n = np.abs(part.rows("command_v")).max(), np.abs(part.rows("inputs")[:, 0]).max()
    assert part.end["reason"] in ("no_lock", "no_lock_in_window")
    assert highest_v < 1.001 * lowest_v
    assert highest_n < 1.0
    assert "polarity" in part.end["text"]
    assert not any(point["accepted"] for point in points)
    assert len(points) == 13


def _verdict(state, clamped, far, elapsed):
    settling, lock = np.zeros(1, SETTLING), np.zeros(1, LOCK)
    settling["clamped_in_row"], lock["state"], lock["out_of_band_periods"] = clamped, state, far
    return Outcome(start_verdict(settling[0], lock[0], elapsed))


@pytest.mark.parametrize(
    ("state", "clamped", "far", "elapsed", "outcome"),
    [
        (LockState.LOCKED, CLAMPED_PERIODS, 0, 40.0, Outcome.DONE),
        (LockState.ACQUIRING, 0, 0, 10.0, Outcome.DONE),
        (LockState.ACQUIRING, CLAMPED_PERIODS, 0, 40.0, Outcome.OUTSIDE_WINDOW),
        (LockState.ACQUIRING, CLAMPED_PERIODS - 1, 0, 40.0, Outcome.RUNNING),  # in doubt: a little longer
        (LockState.ACQUIRING, 0, FAR_PERIODS, 100.0, Outcome.NOT_LOCKED),
        (LockState.ACQUIRING, 0, 40, 40.0, Outcome.RUNNING),
        (LockState.ACQUIRING, 0, 10, 10.0, Outcome.RUNNING),
        (LockState.ACQUIRING, 0, 30, 40.0, Outcome.DONE),  # it was close once: a lock that swings
        (LockState.SEARCHING, 0, 0, 40.0, Outcome.NOT_SETTLED),
    ],
)
def test_a_start_is_refused_only_where_there_was_no_sign_of_a_lock(state, clamped, far, elapsed, outcome):
    assert _verdict(state, clamped, far, elapsed) is outcome


@pytest.mark.parametrize("seed", [1, 2])
def test_a_lock_that_swings_at_plain_voltage_is_let_through(seed):
    """On the friction beam the lag is 118 deg off at the end of the start, and never locked before."""
    with rig.run("friction-beam/stepped-phase-fast", seed=seed) as run:
        assert run.complete


@pytest.mark.parametrize("plan", ["friction-beam/continuous-backbone", "friction-beam/backbone-short"])
def test_a_first_lock_that_noise_makes_late_is_waited_for(plan):
    """With ten times the noise this seed has its first period near the wanted lag after about 40."""
    with rig.run(plan, bench=bench_with(name="friction-beam", noise_scale=10.0), seed=30) as run:
        assert run.complete
