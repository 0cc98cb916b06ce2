"""The shipped backbone tests against harmonic balance of the coupled rig, an independent derivation."""

import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.bench import load_bench
from rig.drivers import make_daq
from rig.show.summary import summarise_recording
from simulators import VirtualRig
from tests.recorded import recorded_run
from tests.reference.harmonic_balance import backbone, backbone_at_voltages
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.sign_detector import sign_lock

RIGS = {"magnet-beam": ONE_SIDED, "magnet-beam-symmetric": SYMMETRIC}


@pytest.fixture(scope="module", params=list(RIGS))
def measured(request):
    with recorded_run(f"{request.param}/backbone") as run:
        yield request.param, run, run.backbone()


def test_the_shipped_backbone_completes_with_every_point_accepted(measured):
    _, run, points = measured
    summary = summarise_recording(run.recording)
    assert summary["complete"]
    assert len(points.points) == len(summary["points"]) == 13
    assert all(point["settled"] and point["accepted"] for point in summary["points"])
    assert all(count == 0 for count in summary["counters"].values())


def test_force_frequency_and_damping_of_every_point_are_those_of_harmonic_balance(measured):
    name, run, points = measured
    voltages = [point["level"] for point in run.recording.points]
    mode = nonlinear_mode(points)
    truth = backbone_at_voltages(RIGS[name], voltages)
    np.testing.assert_allclose(mode.frequency_hz, [t.frequency_hz for t in truth], rtol=1e-4)
    np.testing.assert_allclose(mode.force_n, [t.force_amplitude_n for t in truth], rtol=2.5e-3)
    np.testing.assert_allclose(mode.damping_ratio, [t.damping_ratio for t in truth], rtol=2.5e-3)
    total = [t.damping_ratio_of_total_power for t in truth]
    np.testing.assert_allclose(mode.damping_ratio_total_power, total, rtol=3e-3)


def test_the_backbone_has_the_shift_and_the_damping_of_the_paper(measured):
    _, _, points = measured
    mode = nonlinear_mode(points)
    assert mode.force_n[0] == pytest.approx(0.026, abs=3e-4)
    assert mode.force_n[-1] == pytest.approx(0.56, abs=3e-3)
    assert 100 * mode.frequency_shift == pytest.approx(3.7, abs=0.05)  # paper: +3.7 %
    assert 100 * mode.damping_ratio[0] == pytest.approx(0.400, abs=0.005)  # paper: 0.40 -> 0.45 %
    assert 100 * mode.damping_ratio[-1] == pytest.approx(0.450, abs=0.005)


def test_harmonics_of_the_one_sided_force_are_those_of_harmonic_balance():
    with recorded_run("magnet-beam/backbone") as run:
        mode = nonlinear_mode(run.backbone())
    truth = backbone(ONE_SIDED, mode.force_n.tolist())
    for harmonic in (2, 3):
        expected = [abs(t.force_n[harmonic] / t.force_n[1]) for t in truth]
        np.testing.assert_allclose(mode.force_harmonic_ratio(harmonic), expected, atol=0.01)


def test_the_sign_detector_locks_where_its_own_mean_vanishes_and_the_file_says_how_far_off_that_is():
    with rig.run("magnet-beam/backbone-sign", seed=4) as run:
        points = {round(point["level"], 4): point for point in run.recording.points}
    levels = [1.6525, 2.2971, 3.0948]
    for level, truth in zip(levels, sign_lock(ONE_SIDED, levels), strict=True):
        point = points[level]
        assert point["frequency_hz"] == pytest.approx(truth.frequency_hz, rel=5e-4)
        assert point["phase_error_deg"] == pytest.approx(-90.0 - truth.lag_deg, abs=2.5)
        assert abs(point["phase_error_deg"]) > 5.0


@pytest.mark.parametrize("name", RIGS)
def test_the_bench_file_knows_the_mode_shape_of_its_own_virtual_rig(name):
    bench = load_bench(name)
    rig_ = VirtualRig(specimen=bench.driver.options["specimen"])
    assert bench.specimen.drive_mode_shape == pytest.approx(
        rig_.drive_shape(bench.specimen.linear_frequency_hz), rel=1e-5
    )
    assert bench.specimen.linear_frequency_hz == pytest.approx(rig_.linear_modes.frequency_hz[0], rel=1e-5)
    for channel, sensor in zip(bench.channels, rig_.sensors, strict=True):
        assert channel.sensitivity_v_per_unit == sensor.sensitivity_v_per_unit
        assert channel.range_v == sensor.range_v
        assert channel.noise_rms == sensor.noise_rms
    assert make_daq(bench).capabilities.virtual
