import numpy as np
import pytest

from tests.reference.balance import Balance, Conditions
from tests.reference.coupled_rig import CoupledRig
from tests.reference.harmonic_balance import backbone, backbone_at_voltages, linear_start, response_to_voltage, sequence
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.refused import refused

BOTH = pytest.mark.parametrize("rig", [ONE_SIDED, SYMMETRIC], ids=["one-sided", "symmetric"])
LEVELS_N = np.geomspace(0.026, 0.56, 7).tolist()


@pytest.mark.parametrize(
    "conditions",
    [
        Conditions(force_n=0.4, lag_deg=-90.0),
        Conditions(force_n=0.4, omega_rad_s=150.0),
        Conditions(voltage_v=2.0, lag_deg=-70.0),
        Conditions(voltage_v=2.0, omega_rad_s=150.0),
    ],
    ids=str,
)
def test_jacobian_agrees_with_finite_differences(conditions: Conditions) -> None:
    balance = Balance(ONE_SIDED, 5, 128)
    y = linear_start(balance, Conditions(force_n=0.3, lag_deg=-90.0))
    y[: 2 * balance.size] += 1e-5 * np.random.default_rng(1).standard_normal(2 * balance.size)
    jacobian = balance.residual(y, conditions)[1]
    for column in range(y.size):
        step = np.zeros_like(y)
        step[column] = 1e-9 if column < 2 * balance.size else 1e-6 * abs(y[column])
        ends = [balance.residual(y + sign * step, conditions)[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * step[column])
        assert np.max(np.abs(difference - jacobian[:, column])) < 1e-5 * np.max(np.abs(jacobian[:, column]))


@BOTH
@pytest.mark.parametrize("frequency_hz", [10.0, 23.0, 24.37, 26.0, 60.0, 134.0])
def test_low_level_responses_are_the_closed_form_frfs(rig: CoupledRig, frequency_hz: float) -> None:
    voltage = 1e-4
    s = 2j * np.pi * frequency_hz
    modes = 1.0 / (s**2 + 2 * rig.zeta * rig.w_rad_s * s + rig.w_rad_s**2)
    k_lin = -float(rig.magnet_slope(np.zeros(1))[0])
    across = np.sum(rig.phi_drive * modes * rig.phi_magnet)
    bare = np.sum(rig.phi_drive**2 * modes)
    receptance = bare - k_lin * across**2 / (1 + k_lin * np.sum(rig.phi_magnet**2 * modes))
    per_displacement = 1 / (1 / (rig.stinger_k + s * rig.stinger_c) + receptance)
    coil = rig.coil_l * s + rig.coil_r
    armature = rig.armature_m * s**2 + rig.armature_c * s + rig.armature_k + s * rig.motor_g**2 / coil
    force = per_displacement * rig.motor_g * voltage / coil / (armature + per_displacement)
    state = response_to_voltage(rig, [voltage], frequency_hz)[0]
    assert abs(state.force_n[1] / force - 1) < 1e-6
    assert abs(state.drive_m[1] / (receptance * force) - 1) < 1e-6


def test_one_sided_backbone_has_the_documented_shift_and_damping() -> None:
    points = backbone(ONE_SIDED, LEVELS_N)
    assert points[-1].frequency_hz / points[0].frequency_hz - 1 == pytest.approx(0.0371, abs=1e-4)
    assert 100 * points[0].damping_ratio == pytest.approx(0.400, abs=1e-3)
    assert 100 * points[-1].damping_ratio == pytest.approx(0.450, abs=1e-3)


def test_symmetric_backbone_has_the_documented_shift_and_damping() -> None:
    points = backbone(SYMMETRIC, LEVELS_N)
    assert points[-1].frequency_hz / points[0].frequency_hz - 1 == pytest.approx(0.0374, abs=3e-4)
    assert 100 * points[0].damping_ratio == pytest.approx(0.400, abs=1e-3)
    assert 100 * points[-1].damping_ratio == pytest.approx(0.449, abs=1.5e-3)


def test_the_force_is_as_rich_in_harmonics_as_documented() -> None:
    one_sided = backbone(ONE_SIDED, [0.52])[0]
    assert abs(one_sided.force_n[2] / one_sided.force_n[1]) == pytest.approx(1.8, abs=0.05)
    assert abs(one_sided.force_n[3] / one_sided.force_n[1]) == pytest.approx(0.68, abs=0.02)
    symmetric = backbone(SYMMETRIC, [0.6])[0]
    assert abs(symmetric.force_n[3] / symmetric.force_n[1]) == pytest.approx(0.44, abs=0.01)
    assert np.max(np.abs(symmetric.force_n[2::2])) < 1e-9


@BOTH
def test_every_point_is_at_phase_resonance_and_at_its_force(rig: CoupledRig) -> None:
    for force, state in zip(LEVELS_N, backbone(rig, LEVELS_N), strict=True):
        assert state.lag_deg == pytest.approx(-90.0, abs=1e-7)
        assert state.force_amplitude_n == pytest.approx(force, rel=1e-8)


@BOTH
def test_following_voltages_finds_the_points_of_following_forces(rig: CoupledRig) -> None:
    by_force = backbone(rig, LEVELS_N)
    by_voltage = backbone_at_voltages(rig, [state.voltage_v for state in by_force])
    for one, other in zip(by_force, by_voltage, strict=True):
        assert one.omega_rad_s == pytest.approx(other.omega_rad_s, rel=1e-8)
        assert one.force_amplitude_n == pytest.approx(other.force_amplitude_n, rel=1e-6)


@BOTH
def test_more_harmonics_and_samples_change_nothing_that_matters(rig: CoupledRig) -> None:
    coarse = backbone(rig, [0.56])[0]
    fine = sequence(Balance(rig, 25, 1024), [Conditions(force_n=0.56, lag_deg=-90.0)])[0]
    assert coarse.frequency_hz == pytest.approx(fine.frequency_hz, rel=5e-6)
    assert coarse.damping_ratio == pytest.approx(fine.damping_ratio, rel=5e-4)


def test_without_friction_nor_magnets_the_rig_is_linear() -> None:
    states = backbone_at_voltages(ONE_SIDED.without_friction().without_magnets(), [0.1, 5.0])
    assert states[1].force_amplitude_n / states[0].force_amplitude_n == pytest.approx(50.0, rel=1e-9)
    assert states[1].damping_ratio == pytest.approx(ONE_SIDED.zeta[0], rel=2e-3)


def test_a_point_needs_exactly_one_level_and_one_of_lag_and_frequency() -> None:
    with refused(ValueError, "force-n-and-voltage-v"):
        Conditions(lag_deg=-90.0)
    with refused(ValueError, "lag-deg-and-omega-rad-s"):
        Conditions(force_n=1.0)
