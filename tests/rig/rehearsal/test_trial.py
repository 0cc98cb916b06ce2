"""A trial is the test itself: the same points as a recorded run, the peaks of its rows, its end."""

import numpy as np
import pytest

import rig
from rig.campaigns.evaluation.recorded import points_of
from rig.rehearsal.trial import run_trial
from rig.rehearsal.truth import true_backbone
from tests.rig.rehearsal.plans import SHORT, magnet_beam
from tests.rig.rigs import bench_with


def test_a_trial_measures_what_a_recorded_run_measures(tmp_path):
    trial = run_trial(SHORT, magnet_beam(), 3)
    with rig.run(SHORT, bench=magnet_beam(), seed=3, output=tmp_path / "run.h5") as run:
        points = points_of(run.recording)
        part = run.recording.parts[0]
        rows = part.read(0, part.n_rows)
    assert [p.modal_frequency_hz for p in trial.points] == [p.modal.modal_frequency_hz for p in points]
    assert [p.damping_ratio for p in trial.points] == [p.modal.damping_ratio for p in points]
    assert (trial.completed, trial.tripped, trial.lost_lock) == (True, False, False)
    assert trial.duration_s == pytest.approx(part.n_rows / 5000.0)
    assert trial.shares["force force"] == pytest.approx(np.abs(rows["inputs"][:, 0]).max() / 34.0)
    assert trial.shares["voltage"] == pytest.approx(np.abs(rows["output_v"]).max() / 9.5)
    amplitude = max(point.vibration.amplitude_m for point in points)
    assert trial.shares["displacement drive"] == pytest.approx(amplitude / 0.006, rel=0.03)


def test_a_trip_is_named_with_channel_and_level():
    bench = bench_with({"limits": {"displacement_m": 2e-4}})
    trial = run_trial(SHORT.model_copy(update={"levels_v": (0.1, 0.8)}), bench, 0)
    assert (trial.end, trial.tripped, trial.channel, trial.level) == ("DISPLACEMENT_LIMIT", True, "acc_magnet", 0.8)
    assert max(share for name, share in trial.shares.items() if name.startswith("displacement")) >= 1.0
    assert [point.accepted for point in trial.points] == [True, False]


def test_a_plan_that_the_bench_refuses_is_a_result_and_not_an_error():
    trial = run_trial(SHORT.model_copy(update={"levels_v": (20.0,)}), magnet_beam(), 0)
    assert trial.end == "REFUSED"
    assert "`levels_v[0]` = 20 V" in trial.text
    assert not trial.points


def test_harmonic_balance_agrees_with_a_trial():
    bench = magnet_beam()
    trial = run_trial(SHORT, bench, 0)
    truth = true_backbone(bench, trial)
    assert truth.numbers == (0, 1)
    for point, hertz, ratio in zip(trial.points, truth.frequency_hz, truth.damping_ratio, strict=True):
        assert point.modal_frequency_hz == pytest.approx(hertz, rel=2e-5)
        assert point.damping_ratio == pytest.approx(ratio, rel=5e-3)
