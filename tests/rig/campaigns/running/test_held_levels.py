"""Tests that hold displacement or force, on the virtual magnet beam, against harmonic balance of it."""

import numpy as np
import pytest

import rig
from identification import IdentificationError
from rig.campaigns.plans import load_plan, plan_from
from rig.errors import RecordingError
from simulators import VirtualRig
from simulators.analysis import constant_force_response
from tests.refused import refused

FORCE_N = 0.25
LAGS_DEG = np.arange(-150.0, -29.0, 30.0)
LEVELS_M = (0.45e-3, 0.56e-3, 0.71e-3, 0.89e-3, 1.11e-3)
LOOPS = load_plan("magnet-beam/stepped-sine-up").model_dump(mode="json")["controller"]
TONE = {"bench": "magnet-beam", "start_v": 0.3, "controller": LOOPS}


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    plan = load_plan("magnet-beam/response-controlled").model_copy(
        update={"levels_m": LEVELS_M, "phase_lags_deg": (-153.0, -120.0, -90.0, -60.0, -27.0)}
    )
    with rig.run(plan, output=tmp_path_factory.mktemp("held") / "held.h5") as run:
        yield run


@pytest.fixture(scope="module")
def truth():
    return constant_force_response(VirtualRig.shipped("magnet-beam"), FORCE_N, LAGS_DEG, harmonics=15, samples=256)


def test_the_curve_at_constant_force_is_that_of_harmonic_balance_with_its_unstable_branch(held, truth):
    assert held.complete
    curve = held.force_surface().constant_force(FORCE_N, LAGS_DEG + 180.0)
    np.testing.assert_allclose(curve.response.amplitude_m, truth.amplitude_m, rtol=0.005)
    np.testing.assert_allclose(curve.response.frequency_hz, truth.frequency_hz, rtol=1e-4)
    np.testing.assert_array_equal(curve.stable, truth.stable)
    assert not curve.stable.all()


def test_points_hold_displacement_and_lag_and_say_so(held):
    for point in held.recording.latest.values():
        assert abs(point["amplitude_m"] / point["level"] - 1.0) < 0.002
        assert point["level_error"] == pytest.approx(point["amplitude_m"] / point["level"] - 1.0)
        assert point["phase_lag_deg"] == pytest.approx(point["asked_phase_lag_deg"] + 180.0, abs=0.5)
        assert point["settle_periods"] < 60.0


def test_every_level_is_a_frequency_response_in_metres(held):
    responses = held.frequency_responses()
    assert [(one.controlled, one.kind, one.level_unit) for one in responses] == [("response", "displacement", "m")] * 5
    assert [one.level for one in responses] == list(LEVELS_M)
    for one in responses:
        np.testing.assert_allclose(one.amplitude_m, one.level, rtol=0.002)
        assert np.all(np.diff(one.frequency_hz) > 0.0)


def test_points_that_missed_their_level_are_not_accepted_and_say_by_how_much():
    table = load_plan("magnet-beam/response-controlled").model_dump(mode="json")
    table |= {"levels_m": [5e-4], "phase_lags_deg": [-90.0], "accepted_level_error": 1e-5, "record_periods": 5}
    with rig.run(plan_from(table, "strict")) as run:
        (point,) = run.recording.latest.values()
        assert not point["accepted"]
        assert "accepted up to 0.001 %" in point["reason"]
        with refused(IdentificationError, "none-of-the-recording-was-accepted", field="points"):
            run.force_surface()


def test_levels_are_added_to_a_recording_and_make_a_surface_with_those_before(tmp_path):
    few = load_plan("magnet-beam/response-controlled").model_copy(
        update={"levels_m": LEVELS_M[:2], "phase_lags_deg": (-130.0, -100.0, -80.0, -50.0), "record_periods": 5}
    )
    rig.run(few, output=tmp_path / "held.h5").close()
    with rig.resume(tmp_path / "held.h5", plan=few.model_copy(update={"levels_m": LEVELS_M[:3]})) as run:
        assert run.complete
        assert [len(part.points) for part in run.recording.parts] == [8, 4]
        np.testing.assert_allclose(run.force_surface().amplitude_m, LEVELS_M[:3], rtol=0.002)


def test_a_stepped_sine_at_constant_force_falls_off_the_curve_at_its_turning_point(truth):
    plan = plan_from(
        TONE | {"kind": "stepped-sine", "levels_n": [FORCE_N], "frequencies_hz": [24.45, 24.53, 24.63]}, "up"
    )
    with rig.run(plan) as run:
        assert run.complete
        (response,) = run.frequency_responses()
        errors = [point["level_error"] for point in run.recording.latest.values()]
        with refused(IdentificationError, "held-force-must-hold-the-response-2", field="responses"):
            run.force_surface()
    assert (response.controlled, response.level) == ("force", FORCE_N)
    np.testing.assert_allclose(response.force_n, FORCE_N, rtol=0.01)
    np.testing.assert_allclose(response.force_n / FORCE_N - 1.0, errors, atol=1e-9)
    below = np.interp(response.frequency_hz[:2], truth.frequency_hz[:3], truth.phase_lag_deg[:3] + 180.0)
    np.testing.assert_allclose(response.phase_lag_deg[:2], below, atol=6.0)
    assert response.phase_lag_deg[2] > 150.0
    assert response.amplitude_m[2] < 0.5 * response.amplitude_m[1]


def test_a_held_root_mean_square_is_no_constant_fundamental():
    table = {"kind": "stepped-sine", "levels_rms_n": [0.1768], "frequencies_hz": [24.4]}
    with rig.run(plan_from(TONE | table, "rms")) as run:
        (point,) = run.recording.latest.values()
        assert point["accepted"]
        assert abs(point["level_error"]) < 0.01
        (response,) = run.frequency_responses()
    harmonics = np.abs(np.array(point["harmonics"])[0] @ [1.0, 1j])[1:]
    assert np.sqrt(0.5 * np.sum(harmonics**2)) == pytest.approx(0.1768, rel=0.01)
    assert response.controlled == "none"
    assert response.label == "0.1768 N RMS"


def test_a_sweep_says_how_well_its_force_was_held_and_where_not():
    table = {"kind": "sweep", "levels_n": [FORCE_N], "start_hz": 24.3, "stop_hz": 24.8, "rate_hz_per_s": 0.05}
    with rig.run(plan_from(TONE | table | {"hold_periods": 80}, "sweep")) as run:
        (point,) = run.recording.latest.values()
        force = np.abs(run.sweeps()[0].force) / FORCE_N
        with refused(RecordingError, "the-recording-is-sweep-wanted-is"):
            run.force_surface()
    assert (point["held_least"], point["held_most"]) == pytest.approx((force.min(), force.max()))
    assert 24.55 < point["held_most_frequency_hz"] < 24.75
    assert any(f"the force rose to {100 * force.max():.1f} % of its level" in line for line in point["warnings"])
    assert point["saturated_share"] == 0.0
    assert point["accepted"]
    assert point["held_usual_error"] == pytest.approx(np.quantile(np.abs(force - 1.0), 0.75), rel=1e-6)


def test_a_sweep_that_is_too_fast_for_its_loop_is_not_accepted():
    table = {"kind": "sweep", "levels_n": [FORCE_N], "start_hz": 24.3, "stop_hz": 24.8, "rate_hz_per_s": 0.5}
    table |= {"hold_periods": 80, "accepted_level_error": 0.05}
    with rig.run(plan_from(TONE | table, "sweep")) as run:
        (point,) = run.recording.latest.values()
    assert point["held_usual_error"] > 0.05
    off = f"the force is more than {100.0 * point['held_usual_error']:.3g} % off its level in 25 % of the sweep"
    assert (point["accepted"], point["reason"]) == (False, f"{off}, accepted up to 5 %")


def test_a_sweep_of_given_voltage_says_nothing_of_holding():
    table = {"kind": "sweep", "bench": "magnet-beam", "levels_v": [0.3], "start_hz": 22.0, "stop_hz": 27.0}
    with rig.run(plan_from(table | {"rate_hz_per_s": 5.0}, "sweep")) as run:
        assert "held_least" not in run.recording.latest[0]
