"""The structure alone under a sinusoidal force, against time integration, the Jacobian, and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from simulators.analysis import phase_resonance_backbone
from simulators.analysis.balance import Balance
from simulators.analysis.conditions import Conditions
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.analysis.rigs import every_site
from tests.simulators.references import EquationsOfMotion, ideal


def test_dop853_stays_on_the_vibration_that_is_found() -> None:
    rig = ideal(friction=[])
    found = phase_resonance_backbone(rig, forces_n=[0.05, 0.5], excitation="pure-sine", harmonics=21)
    equations, m = EquationsOfMotion(rig), rig.plant.n_mode
    omega, force = 2 * np.pi * found.frequency_hz[1], found.force_harmonics_n[1, 1]
    points = [at for at in rig.structure.points if at != "clamp"]
    shapes = np.array([rig.shape(at) for at in points])
    modal = np.linalg.lstsq(shapes, np.array([found.point_harmonics_m[at][1] for at in points]), rcond=None)[0]
    orders = np.arange(modal.shape[1])

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        q, v = x[:m], x[m:]
        acceleration = equations.drive * np.real(force * np.exp(1j * omega * t))
        acceleration = acceleration - 2 * equations.zeta * equations.omega * v - equations.omega**2 * q
        magnet = sum(row * equations.magnet_force_n(k, float(row @ q)) for k, row in enumerate(equations.rows))
        return np.concatenate([v, acceleration + magnet])

    start = np.concatenate([modal.sum(axis=1).real, (1j * omega * orders * modal).sum(axis=1).real])
    times = 2 * np.pi / omega * np.arange(3 * 64) / 64
    path = solve_ivp(rate, (0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-14).y[:m]
    expected = np.real(modal @ np.exp(1j * np.outer(orders, omega * times)))
    np.testing.assert_allclose(shapes @ path, shapes @ expected, atol=2e-6 * found.amplitude_m[1])


def test_the_force_has_no_harmonics_and_its_power_is_all_there_is() -> None:
    for name in ("magnet-beam", "friction-beam"):
        levels = [0.1, 0.5] if name == "magnet-beam" else [1.0, 15.0]
        found = phase_resonance_backbone(VirtualRig.shipped(name), forces_n=levels, excitation="pure-sine")
        np.testing.assert_allclose(found.force_n, levels, rtol=1e-9)
        np.testing.assert_allclose(found.force_harmonics_n[:, 2:], 0.0, atol=1e-9 * levels[-1])
        np.testing.assert_allclose(found.phase_lag_deg, -90.0, atol=1e-6)
        np.testing.assert_allclose(found.damping_ratio, found.damping_ratio_total_power, rtol=1e-9)
        assert np.isnan(found.voltage_v).all()
        for sensor in VirtualRig.shipped(name).sensors:
            order = (2j * np.pi * np.outer(found.frequency_hz, np.arange(16))) ** 2
            expected = found.force_harmonics_n if sensor.at is None else order * found.point_harmonics_m[sensor.at]
            scale = np.abs(expected).max()
            np.testing.assert_allclose(found.sensor_harmonics[sensor.name], expected, atol=1e-7 * scale)


def test_the_one_sided_magnet_beam_has_the_documented_pure_sine_damping() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    coupled = phase_resonance_backbone(rig, forces_n=[0.55])
    pure = phase_resonance_backbone(rig, forces_n=[0.45, 0.48, 0.5, 0.52], excitation="pure-sine")
    damping = np.interp(coupled.amplitude_m, pure.amplitude_m, pure.damping_ratio)
    assert 100 * coupled.damping_ratio[0] == pytest.approx(0.449, abs=0.001)
    assert 100 * damping[0] == pytest.approx(0.411, abs=0.001)
    assert coupled.damping_ratio_total_power[0] == pytest.approx(damping[0], rel=0.006)


@pytest.mark.parametrize("at", ["lag", "frequency"])
def test_jacobian_agrees_with_finite_differences(at: str) -> None:
    balance = Balance(every_site(), 4, 128, pure_sine=True)
    conditions = Conditions("force", 0.4, at, -1.5 if at == "lag" else 150.0)
    y = balance.linear_start(Conditions("force", 0.3, "lag", -np.pi / 2), 153.0)
    y[:-2] += 1e-5 * np.random.default_rng(1).standard_normal(y.size - 2)
    jacobian = balance.residual(y, conditions)[1]
    for column in range(y.size):
        step = np.zeros_like(y)
        step[column] = 1e-9 if column < y.size - 2 else 1e-6 * abs(y[column])
        ahead, back = (balance.residual(y + sign * step, conditions)[0] for sign in (1, -1))
        difference = (ahead - back) / (2 * step[column])
        np.testing.assert_allclose(jacobian[:, column], difference, atol=2e-5 * max(np.max(np.abs(difference)), 1e-12))


def test_what_a_pure_sine_cannot_be_given_is_named() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    with refused(ValueError, "allowed-with-excitation-exciter", field="voltages_v"):
        phase_resonance_backbone(rig, voltages_v=[1.0], excitation="pure-sine")
    with refused(ValueError, field="excitation", value="square", allowed="exciter, pure-sine"):
        phase_resonance_backbone(rig, forces_n=[1.0], excitation="square")
