"""Stepped phase on the virtual rigs against harmonic balance of the coupled rig, folds included."""

import numpy as np
import pytest

import rig
from rig.campaigns.plans import load_plan
from simulators import VirtualRig
from simulators.analysis import constant_force_response


def _truth(specimen, level_n, lags, rms):
    return constant_force_response(
        VirtualRig.shipped(specimen), level_n, lags, quantity="rms" if rms else "fundamental"
    )


def _shortened(name, level, lags):
    plan = load_plan(name)
    return plan.model_copy(
        update={plan.levels_key: (level,), "start_deg": None, "stop_deg": None, "phase_lags_deg": tuple(lags)}
    )


@pytest.mark.parametrize(
    ("name", "level", "amplitude"),
    [
        ("magnet-beam/stepped-phase-fast", 0.55, 1e-3),
        ("magnet-beam/stepped-phase", 0.388909, 1e-3),
        ("friction-beam/stepped-phase-fast", 15.0, 3e-3),
        ("friction-beam/stepped-phase", 3.53553, 3e-3),
    ],
)
def test_every_point_lies_on_the_curve_of_harmonic_balance(name, level, amplitude):
    lags = [-150.0, -120.0, -90.0, -80.0, -60.0, -50.0]
    truth = _truth(name.split("/")[0], level, lags, "fast" not in name)
    with rig.run(_shortened(name, level, lags), seed=11) as run:
        assert run.complete, [point["reason"] for point in run.recording.points]
        points = list(run.recording.latest.values())
        (response,) = run.frequency_responses()
    assert max(abs(point["level_error"]) for point in points) < 0.007
    assert max(abs(point["phase_error_deg"]) for point in points) < 0.5
    assert max(point["settle_periods"] for point in points[1:]) < 150
    np.testing.assert_allclose(response.frequency_hz, truth.frequency_hz, rtol=1.5e-4)
    np.testing.assert_allclose(response.amplitude_m, truth.amplitude_m, rtol=amplitude)
    np.testing.assert_allclose([p["damping_ratio"] for p in points], truth.damping_ratio, rtol=0.01)
    if name == "magnet-beam/stepped-phase-fast":  # over the fold: the frequency falls while the lag rises
        assert np.all(np.diff(response.frequency_hz[3:]) < -0.05)
        assert not np.any(truth.stable[3:])


def test_a_test_goes_on_along_its_branch_after_a_change_of_plan(tmp_path):
    first = _shortened("magnet-beam/stepped-phase-fast", 0.55, [-100.0, -80.0])
    then = first.model_copy(update={"phase_lags_deg": (-100.0, -80.0, -60.0)})
    file = tmp_path / "steps.h5"
    rig.run(first, output=file, seed=1).close()
    with rig.resume(file, plan=then) as run:
        assert run.complete
        last = list(run.recording.latest.values())[-1]
        assert (last["part"], last["asked_phase_lag_deg"]) == (1, -60.0)
    truth = _truth("magnet-beam", 0.55, [-60.0], rms=False)
    assert last["amplitude_m"] == pytest.approx(truth.amplitude_m[0], rel=1e-3)


@pytest.mark.slow
def test_a_force_that_is_mostly_another_mode_is_no_point():
    plan = load_plan("friction-beam/stepped-phase-paper").model_copy(update={"levels_rms_n": (1.41421,)})
    with rig.run(plan, seed=0) as run:
        points = list(run.recording.latest.values())
    truth = _truth("friction-beam", 1.41421, [-30.0], rms=True)
    lost = [point for point in points if point["asked_phase_lag_deg"] <= -130.0]
    assert lost
    assert not any(point["accepted"] for point in lost)  # the paper's force loop does not hold there
    swinging = [point for point in points if point.get("nonharmonic_force", 0.0) > 0.3]
    assert swinging
    assert all("not harmonic" in point["reason"] for point in swinging)
    assert points[-1]["accepted"]
    assert points[-1]["frequency_hz"] == pytest.approx(truth.frequency_hz[0], rel=1e-3)
