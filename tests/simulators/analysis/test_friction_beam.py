"""The friction beam by harmonic balance: what is known of it, and time integration at ten levels."""

import numpy as np
import pytest
from numpy.typing import NDArray

from simulators.analysis.frequency_responses import frequency_response
from simulators.analysis.harmonic_balance import constant_force_response, phase_resonance_backbone
from simulators.analysis.responses import PeriodicResponses
from simulators.analysis.site_forces import hysteresis_loops
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

LEVELS_N = np.geomspace(0.1, 16.6, 10)


@pytest.fixture(scope="module")
def backbone() -> PeriodicResponses:
    return phase_resonance_backbone(ideal("friction-beam"), forces_n=LEVELS_N)


def settled(rig: VirtualRig, voltage_v: float, frequency_hz: float) -> NDArray[np.complex128]:
    """Fundamentals of stinger force and drive-point displacement, sampled, under a held voltage."""
    rate = rig.converter.sample_rate_hz
    theta = 2 * np.pi * frequency_hz / rate * np.arange(round(6.0 * rate))
    rise = np.minimum(theta / (200 * np.pi), 1.0)
    run = Simulation(rig).run(voltage_v / np.sinc(frequency_hz / rate) * rise * np.cos(theta))
    last = theta > theta[-1] - 80 * np.pi
    waves = np.hstack(
        [f(np.outer(theta[last], np.arange(1, 8))) for f in (np.cos, np.sin)] + [np.ones((last.sum(), 1))]
    )
    fit = np.linalg.lstsq(waves, np.column_stack([run.force_n, run.displacement_m["drive"]])[last], rcond=None)[0]
    return fit[0] - 1j * fit[7]


def modal(rig: VirtualRig, force: complex, drive: complex, frequency_hz: float) -> tuple[float, float]:
    """Modal frequency (Hz) and damping ratio from w^2 - W^2 + 2 i W w z = phi_d^2 F / X."""
    w, stiff = 2 * np.pi * frequency_hz, rig.linear_modes.drive_shape[2] ** 2 * force / drive
    frequency = np.sqrt(w**2 + stiff.real)
    return frequency / (2 * np.pi), stiff.imag / (2 * w * frequency)


def test_frequency_and_damping_over_the_backbone_are_as_documented(backbone: PeriodicResponses) -> None:
    assert 100 * backbone.frequency_shift == pytest.approx(-2.22, abs=0.03)
    assert 100 * backbone.damping_ratio[0] == pytest.approx(0.171, abs=0.01)
    assert 100 * backbone.damping_ratio[-1] == pytest.approx(1.322, abs=0.02)
    assert backbone.force_harmonic_ratio(3)[-1] == pytest.approx(0.012, abs=0.002)
    assert not np.any(backbone.flags)


def test_more_harmonics_and_samples_change_nothing_that_matters(backbone: PeriodicResponses) -> None:
    fine = phase_resonance_backbone(ideal("friction-beam"), forces_n=LEVELS_N[[0, 5, 9]], harmonics=23, samples=2048)
    np.testing.assert_allclose(backbone.frequency_hz[[0, 5, 9]], fine.frequency_hz, rtol=1e-6)
    np.testing.assert_allclose(backbone.damping_ratio[[0, 5, 9]], fine.damping_ratio, rtol=1e-4)


def test_the_rig_settles_at_ten_levels_where_harmonic_balance_says(backbone: PeriodicResponses) -> None:
    rig = ideal("friction-beam", converter={"sample_rate_hz": 20000.0, "substeps": 2})
    for k, at_hz in enumerate(backbone.frequency_hz):
        force, drive = settled(rig, backbone.voltage_v[k], at_hz)
        frequency_hz, damping = modal(rig, force, drive, at_hz)
        assert frequency_hz == pytest.approx(backbone.modal_frequency_hz[k], rel=3e-6)
        assert damping == pytest.approx(backbone.damping_ratio[k], rel=5e-4)
        assert abs(drive) == pytest.approx(backbone.amplitude_m[k], rel=1e-4)
        assert abs(force) == pytest.approx(backbone.force_n[k], rel=5e-4)


def test_at_the_rate_of_a_test_the_stairs_of_the_output_alias_as_the_held_frequency_response_says(
    backbone: PeriodicResponses,
) -> None:
    rig = ideal("friction-beam")
    at_hz, half_sample = backbone.frequency_hz, np.pi * backbone.frequency_hz / rig.converter.sample_rate_hz
    held, continuous = (frequency_response(rig, at_hz, held=held).force_n_per_v for held in (True, False))
    hold = np.sinc(at_hz / rig.converter.sample_rate_hz) * np.exp(-1j * half_sample)
    images = (held / hold - continuous) * backbone.voltage_v
    share = np.abs(images / backbone.force_harmonics_n[:, 1])
    assert share[0] > 0.01, "it matters where the force is small"
    for k in (0, 4, 9):
        force, drive = settled(rig, backbone.voltage_v[k], at_hz[k])
        frequency_hz, damping = modal(rig, force, drive, at_hz[k])
        expected = modal(rig, backbone.force_harmonics_n[k, 1] + images[k], backbone.drive_harmonics_m[k, 1], at_hz[k])
        assert frequency_hz == pytest.approx(expected[0], rel=1e-5)
        assert damping == pytest.approx(expected[1], rel=1e-3)


def test_joints_lose_what_the_modes_do_not(backbone: PeriodicResponses) -> None:
    rig = ideal("friction-beam")
    for k in (2, 9):
        w, q = 2 * np.pi * backbone.frequency_hz[k], backbone.modal_amplitude[k]
        lost = sum(loop.dissipated_j for loop in hysteresis_loops(rig, backbone, k))
        by_joints = lost / (2 * np.pi * w**2 * q**2)
        viscous = rig.structure.damping_ratio[2] * rig.linear_modes.frequency_hz[2] / backbone.frequency_hz[k]
        assert by_joints > 0.0003
        assert backbone.damping_ratio_total_power[k] == pytest.approx(viscous + by_joints, rel=5e-3)


def test_curves_at_constant_force_lean_to_lower_frequencies_and_have_no_folds() -> None:
    found = [constant_force_response(ideal("friction-beam"), force_n, harmonics=7) for force_n in (2.0, 15.0)]
    peaks = [int(np.argmax(one.amplitude_m)) for one in found]
    assert found[1].frequency_hz[peaks[1]] < found[0].frequency_hz[peaks[0]]
    for one, peak in zip(found, peaks, strict=True):
        assert one.stable is not None
        assert np.all(one.stable)
        assert abs(one.phase_lag_deg[peak] + 90.0) < 10.0
        assert np.max(one.amplitude_m[[0, -1]]) < 0.4 * one.amplitude_m[peak]
        np.testing.assert_allclose(one.force_n, one.force_n[0], rtol=1e-8)
