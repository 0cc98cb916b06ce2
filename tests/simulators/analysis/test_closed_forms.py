"""Harmonic balance where one harmonic has a closed form, and the energy that goes in and out."""

import numpy as np
import pytest

from simulators.analysis.frequency_responses import frequency_response
from simulators.analysis.harmonic_balance import constant_force_response, forced_response, phase_resonance_backbone
from simulators.analysis.site_forces import hysteresis_loops
from tests.simulators.analysis.rigs import DAMPING_RATIO, FREQUENCY_HZ, SHAPE, one_mode
from tests.simulators.references import ideal
from vibrolock.content_cache import c_function

W0 = 2 * np.pi * FREQUENCY_HZ


@c_function("float64(float64, CPointer(float64))")
def quadratic_drag(velocity, parameters):
    return -parameters[0] * velocity * abs(velocity)


@pytest.mark.parametrize("stiffness_n_m3", [3e8, -3e8])
def test_one_harmonic_of_a_cubic_spring_is_duffings(stiffness_n_m3: float) -> None:
    cubic = {"kind": "cubic", "at": "drive", "stiffness_n_m3": stiffness_n_m3}
    found = phase_resonance_backbone(one_mode(elements=[cubic]), forces_n=[0.1, 0.5, 1.0], harmonics=1)
    frequency = np.sqrt(W0**2 + 0.75 * stiffness_n_m3 * SHAPE**2 * found.amplitude_m**2)
    assert abs(frequency[-1] / W0 - 1) > 0.01
    np.testing.assert_allclose(2 * np.pi * found.modal_frequency_hz, frequency, rtol=1e-8)
    np.testing.assert_allclose(found.frequency_hz, found.modal_frequency_hz, rtol=1e-8)
    np.testing.assert_allclose(found.damping_ratio, DAMPING_RATIO * W0 / frequency, rtol=1e-7)


def test_the_folds_under_constant_force_are_where_duffings_curve_turns() -> None:
    stiffness, force = 3e8, 0.6
    cubic = {"kind": "cubic", "at": "drive", "stiffness_n_m3": stiffness}
    found = constant_force_response(one_mode(elements=[cubic]), force, np.linspace(-175, -5, 400), harmonics=1)
    # (w0^2 + 3/4 k a^2 - W^2)^2 + (2 z w0 W)^2 = (phi^2 F / a)^2, on which a fold has a vertical tangent: d/da = 0
    a, w = found.amplitude_m, 2 * np.pi * found.frequency_hz
    stiff = W0**2 + 0.75 * stiffness * SHAPE**2 * a**2 - w**2
    on_curve = stiff**2 + (2 * DAMPING_RATIO * W0 * w) ** 2
    np.testing.assert_allclose(on_curve, (SHAPE**2 * force / a) ** 2, rtol=1e-7)
    by_amplitude = 3 * stiff * stiffness * SHAPE**2 * a + 2 * (SHAPE**2 * force) ** 2 / a**3
    assert found.stable is not None
    np.testing.assert_array_equal(found.stable, by_amplitude > 0)
    assert 40 < np.count_nonzero(~found.stable) < 360


def test_a_users_drag_damps_as_equivalent_linearisation_says() -> None:
    drag = {"kind": "user", "at": "drive", "of": "velocity", "function": quadratic_drag, "parameters": [8.0]}
    found = phase_resonance_backbone(one_mode(elements=[drag]), forces_n=[0.05, 0.5], harmonics=1)
    speed = 2 * np.pi * found.frequency_hz * found.amplitude_m
    added = 8 / (3 * np.pi) * 8.0 * speed * SHAPE**2 / (2 * W0)
    assert added[-1] > DAMPING_RATIO
    np.testing.assert_allclose(found.damping_ratio, DAMPING_RATIO + added, rtol=1e-4)


def test_a_single_element_in_full_slip_loses_what_its_parallelogram_holds() -> None:
    joint = {"kind": "jenkins", "at": "drive", "stiffness": [2000.0], "slip": [2e-5]}
    rig = one_mode(friction=[joint])
    found = phase_resonance_backbone(rig, forces_n=[0.5, 1.0], harmonics=31, samples=2048)
    for k in (0, 1):
        loop = hysteresis_loops(rig, found, k, samples=2048)[0]
        travel = np.ptp(loop.coordinate) / 2
        assert travel > 3e-5
        assert loop.dissipated_j == pytest.approx(4 * 2000.0 * 2e-5 * (travel - 2e-5), rel=1e-4)
        assert np.ptp(loop.force) / 2 == pytest.approx(2000.0 * 2e-5, rel=1e-9)


@pytest.mark.parametrize("specimen", ["magnet-beam", "magnet-beam-symmetric"])
def test_what_the_stinger_puts_in_goes_into_modal_damping_and_joints(specimen: str) -> None:
    rig = ideal(specimen)
    found = phase_resonance_backbone(rig, forces_n=[0.1, 0.5], samples=2048)
    for k in (0, 1):
        orders, w = np.arange(found.force_harmonics_n.shape[1]), 2 * np.pi * found.frequency_hz[k]
        power = 0.5 * np.real(found.force_harmonics_n[k] * np.conj(1j * orders * w * found.drive_harmonics_m[k]))
        shapes = np.array([rig.shape(at) for at in found.point_harmonics_m])
        at_points = np.array([harmonics[k] for harmonics in found.point_harmonics_m.values()])
        modal = np.linalg.lstsq(shapes, at_points, rcond=None)[0]
        viscous = np.sum(0.5 * rig.plant.modal_damping[:, None] * np.abs(orders * w * modal) ** 2)
        joints = sum(loop.dissipated_j for loop in hysteresis_loops(rig, found, k, samples=2048))
        assert joints > 0
        assert power.sum() == pytest.approx(viscous + joints * found.frequency_hz[k], rel=1e-4)


def test_a_rig_without_sites_responds_as_its_frequency_responses_say() -> None:
    rig = ideal(elements=[], friction=[])
    frequencies = np.array([12.0, 21.4, 30.0, 133.0])
    found, linear = forced_response(rig, 2.0, frequencies), frequency_response(rig, frequencies)
    np.testing.assert_allclose(found.force_harmonics_n[:, 1], 2.0 * linear.force_n_per_v, rtol=1e-8)
    for name, per_v in linear.sensor_per_v.items():
        np.testing.assert_allclose(found.sensor_harmonics[name][:, 1], 2.0 * per_v, rtol=1e-8)
    assert np.max(np.abs(found.force_harmonics_n[:, 2:])) == 0.0
    at_resonance = phase_resonance_backbone(one_mode(), voltages_v=[0.5])
    assert at_resonance.damping_ratio[0] == pytest.approx(DAMPING_RATIO, rel=1e-7)
    assert at_resonance.frequency_hz[0] == pytest.approx(FREQUENCY_HZ, rel=1e-9)
