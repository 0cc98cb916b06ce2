"""Magnet beams against the independent harmonic balance and time integration of tests/reference, and numbers known."""

import numpy as np
import pytest

from simulators.analysis.harmonic_balance import constant_force_response, forced_response, phase_resonance_backbone
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.reference.balance import Balance, Conditions
from tests.reference.harmonic_balance import HARMONICS, SAMPLES, backbone, response_to_voltage, sequence
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.time_integration import TimeDomain
from tests.simulators.references import ideal

REFERENCES = {"magnet-beam": ONE_SIDED, "magnet-beam-symmetric": SYMMETRIC}
BOTH = pytest.mark.parametrize("specimen", list(REFERENCES))
LEVELS_N = np.geomspace(0.026, 0.56, 5)


@BOTH
def test_the_backbone_is_that_of_the_reference(specimen: str) -> None:
    found = phase_resonance_backbone(VirtualRig.shipped(specimen), forces_n=LEVELS_N, samples=256)
    truth = backbone(REFERENCES[specimen], LEVELS_N.tolist())
    np.testing.assert_allclose(found.frequency_hz, [one.frequency_hz for one in truth], rtol=1e-7)
    np.testing.assert_allclose(found.voltage_v, [one.voltage_v for one in truth], rtol=1e-6)
    np.testing.assert_allclose(found.amplitude_m, [abs(one.drive_m[1]) for one in truth], rtol=1e-6)
    np.testing.assert_allclose(found.damping_ratio, [one.damping_ratio for one in truth], rtol=1e-6)
    total = [one.damping_ratio_of_total_power for one in truth]
    np.testing.assert_allclose(found.damping_ratio_total_power, total, rtol=1e-6)
    force = np.array([one.force_n for one in truth])
    np.testing.assert_allclose(found.force_harmonics_n, force, atol=1e-5 * 0.56)
    np.testing.assert_allclose(found.force_n, LEVELS_N, rtol=1e-8)
    np.testing.assert_allclose(found.phase_lag_deg, -90.0, atol=1e-6)


@BOTH
def test_seven_harmonics_do_and_what_is_neglected_says_so(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen)
    few, many = (phase_resonance_backbone(rig, forces_n=[0.1, 0.56], harmonics=h) for h in (7, 31))
    np.testing.assert_allclose(few.frequency_hz, many.frequency_hz, rtol=1e-5)
    np.testing.assert_allclose(few.damping_ratio, many.damping_ratio, rtol=2e-4)
    left = np.linalg.norm(many.force_harmonics_n[:, 8:16], axis=1) / many.force_n
    np.testing.assert_allclose(few.neglected_share, left, rtol=0.2)
    assert few.neglected_share[1] > 1e-3


def test_one_sided_force_harmonics_are_as_documented() -> None:
    found = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), forces_n=[0.52])
    assert found.force_harmonic_ratio(2)[0] == pytest.approx(1.8, rel=0.05)
    assert found.force_harmonic_ratio(3)[0] == pytest.approx(0.68, rel=0.05)


@BOTH
def test_frequency_and_damping_over_the_backbone_are_as_documented(specimen: str) -> None:
    found = phase_resonance_backbone(VirtualRig.shipped(specimen), forces_n=LEVELS_N)
    assert 100 * found.frequency_shift == pytest.approx(3.7, abs=0.03)
    assert 100 * found.damping_ratio[0] == pytest.approx(0.400, abs=0.002)
    assert 100 * found.damping_ratio[-1] == pytest.approx(0.450, abs=0.002)


@BOTH
def test_a_curve_at_constant_force_is_that_of_the_reference_at_each_of_its_lags(specimen: str) -> None:
    rig, lags = VirtualRig.shipped(specimen), np.array([-175.0, -130.0, -90.0, -60.0, -20.0, -5.0])
    found = constant_force_response(rig, 0.4, lags, samples=256)
    balance = Balance(REFERENCES[specimen], HARMONICS, SAMPLES)
    ends = [Conditions(force_n=0.4, omega_rad_s=2 * np.pi * found.frequency_hz[k]) for k in (0, -2, -1)]
    first, *last = (sequence(balance, [one])[0] for one in ends)
    truth = [first, *(backbone(REFERENCES[specimen], [0.4], lag)[0] for lag in lags[1:-2]), *last]
    np.testing.assert_allclose([one.lag_deg for one in truth], lags, atol=1e-4)
    np.testing.assert_allclose(found.phase_lag_deg, lags, atol=1e-6)
    np.testing.assert_allclose(found.force_n, 0.4, rtol=1e-8)
    np.testing.assert_allclose(found.frequency_hz, [one.frequency_hz for one in truth], rtol=1e-7)
    np.testing.assert_allclose(found.amplitude_m, [abs(one.drive_m[1]) for one in truth], rtol=1e-5)
    np.testing.assert_allclose(found.voltage_v, [one.voltage_v for one in truth], rtol=1e-5)


def test_between_the_folds_the_frequency_falls_and_the_branch_is_unstable() -> None:
    found = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.55)
    assert found.stable is not None
    falls = np.diff(found.frequency_hz) < 0
    unstable = ~found.stable
    assert np.array_equal(falls[unstable[1:] & unstable[:-1]], np.ones(np.count_nonzero(unstable) - 1, bool))
    assert not np.any(falls[found.stable[1:] & found.stable[:-1]])
    assert np.count_nonzero(unstable) > 20
    assert np.all(found.stable[found.phase_lag_deg < -90])
    assert found.stable[0]
    assert found.stable[-1]
    assert np.max(found.amplitude_m[[0, -1]]) < 0.12 * np.max(found.amplitude_m)
    weak = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.03)
    assert np.all(weak.stable)


def test_a_forced_response_is_that_of_the_reference_up_and_down() -> None:
    rig, frequencies = VirtualRig.shipped("magnet-beam"), np.array([15.0, 23.0, 24.5, 25.1, 30.0])
    truth = [response_to_voltage(ONE_SIDED, [2.0], f)[0] for f in frequencies]
    for order in (slice(None), slice(None, None, -1)):
        found = forced_response(rig, 2.0, frequencies[order], samples=256)
        expected = np.array([one.force_amplitude_n for one in truth])[order]
        np.testing.assert_allclose(found.force_n, expected, rtol=1e-6)
        np.testing.assert_allclose(found.voltage_v, 2.0, rtol=1e-9)


def test_the_force_drops_out_at_resonance_and_overshoots_beside_it() -> None:
    found = forced_response(VirtualRig.shipped("magnet-beam"), 1.0, np.linspace(10.0, 40.0, 200))
    assert found.force_n.min() / found.force_n[0] < 0.07
    assert found.force_n.max() / found.force_n[0] > 1.1


def test_dop853_of_the_rig_without_friction_arrives_at_the_same_vibration() -> None:
    found = phase_resonance_backbone(ideal(friction=[]), forces_n=[0.5])
    reference = ONE_SIDED.without_friction()
    run = TimeDomain(reference, float(found.voltage_v[0]), 2 * np.pi * float(found.frequency_hz[0]))
    states = run.without_friction(45)
    force, drive = run.harmonics(run.force_n(states)), run.harmonics(states @ run.drive_row)
    np.testing.assert_allclose(force[1:4], found.force_harmonics_n[0, 1:4], atol=2e-4 * 0.5)
    np.testing.assert_allclose(drive[0:4], found.drive_harmonics_m[0, 0:4], atol=1e-5 * found.amplitude_m[0])


@BOTH
def test_the_rig_settles_at_ten_levels_where_harmonic_balance_says(specimen: str) -> None:
    rig = ideal(specimen, converter={"sample_rate_hz": 20000.0, "substeps": 1})
    found = phase_resonance_backbone(rig, forces_n=np.geomspace(0.026, 0.56, 10))
    rate, phi = rig.converter.sample_rate_hz, rig.linear_modes.drive_shape[0]
    for k, frequency_hz in enumerate(found.frequency_hz):
        theta = 2 * np.pi * frequency_hz / rate * np.arange(round(6.0 * rate))
        rise = np.minimum(theta / (40 * np.pi), 1.0)
        run = Simulation(rig).run(found.voltage_v[k] / np.sinc(frequency_hz / rate) * rise * np.cos(theta))
        last = theta > theta[-1] - 40 * np.pi
        orders = np.arange(1, 9)
        waves = np.hstack([f(np.outer(theta[last], orders)) for f in (np.cos, np.sin)] + [np.ones((last.sum(), 1))])
        signals = np.column_stack([run.force_n, run.displacement_m["drive"]])[last]
        fit = np.linalg.lstsq(waves, signals, rcond=None)[0]
        force, drive = fit[0] - 1j * fit[8]
        # the modal equation takes out what a slightly different frequency of resonance would do to force and lag
        w = 2 * np.pi * frequency_hz
        modal = np.sqrt(w**2 + (phi**2 * force / drive).real)
        damping = (phi**2 * force / drive).imag / (2 * w * modal)
        assert modal / (2 * np.pi) == pytest.approx(found.modal_frequency_hz[k], rel=1e-5)
        assert damping == pytest.approx(found.damping_ratio[k], rel=2e-3)
        assert abs(drive) == pytest.approx(found.amplitude_m[k], rel=1e-3)


def test_a_few_lags_far_from_resonance_need_nothing_in_between() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    few = constant_force_response(rig, 0.55, [-175.0, -170.0])
    whole = constant_force_response(rig, 0.55, [-175.0, -170.0, -90.0, -10.0])
    np.testing.assert_allclose(few.frequency_hz, whole.frequency_hz[:2], rtol=1e-8)
    np.testing.assert_allclose(few.amplitude_m, whole.amplitude_m[:2], rtol=1e-7)
