"""Prescribed harmonics of the force, in the reference itself: Jacobian, time integration with friction, powers."""

import numpy as np
import pytest

from tests.reference.balance import Balance, Conditions
from tests.reference.coupled_rig import CoupledRig
from tests.reference.harmonic_balance import backbone, linear_start
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.time_integration import TimeDomain

BOTH = pytest.mark.parametrize("rig", [ONE_SIDED, SYMMETRIC], ids=["one-sided", "symmetric"])
ZERO = dict.fromkeys(range(2, 8), 0j)
RATIOS = {2: 0.3 * np.exp(0.7j), 3: -0.2j, 5: 0.05}


@pytest.mark.parametrize(
    "conditions", [Conditions(force_n=0.4, lag_deg=-90.0), Conditions(voltage_v=2.0, omega_rad_s=150.0)], ids=str
)
def test_jacobian_agrees_with_finite_differences(conditions: Conditions) -> None:
    balance = Balance(ONE_SIDED, 5, 128, RATIOS)
    y = linear_start(balance, Conditions(force_n=0.3, lag_deg=-90.0))
    y[: 2 * balance.size] += 1e-5 * np.random.default_rng(1).standard_normal(2 * balance.size)
    jacobian = balance.residual(y, conditions)[1]
    for column in range(y.size):
        step = np.zeros_like(y)
        step[column] = 1e-9 if column < 2 * balance.size else 1e-6 * abs(y[column])
        ends = [balance.residual(y + sign * step, conditions)[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * step[column])
        assert np.max(np.abs(difference - jacobian[:, column])) < 1e-5 * np.max(np.abs(jacobian[:, column]))


@pytest.mark.parametrize("ratios", [ZERO, RATIOS], ids=["zero", "prescribed"])
@BOTH
def test_with_friction_the_voltages_make_the_prescribed_force(rig: CoupledRig, ratios: dict[int, complex]) -> None:
    expected = backbone(rig, [0.56], force_ratios=ratios)[0]
    domain = TimeDomain(rig, expected.voltages_v, expected.omega_rad_s)
    force = domain.harmonics(domain.force_n(domain.with_return_map(60)))
    phase = np.angle(force[1])
    for h, ratio in ratios.items():
        assert force[h] / abs(force[1]) * np.exp(-1j * h * phase) == pytest.approx(ratio, abs=3e-4)
    assert np.max(np.abs(force[:8] - expected.force_n[:8])) < 3e-4 * expected.force_amplitude_n


@BOTH
def test_where_the_force_is_a_sine_the_power_of_the_fundamental_is_all(rig: CoupledRig) -> None:
    free, state = (backbone(rig, [0.56], force_ratios=ratios)[0] for ratios in (None, ZERO))
    assert state.damping_ratio == pytest.approx(state.damping_ratio_of_total_power, rel=1e-6)
    assert abs(free.damping_ratio / free.damping_ratio_of_total_power - 1) > 1e-3
