import numpy as np
import pytest

from simulators.analysis.balance import Balance
from simulators.analysis.conditions import Conditions
from simulators.analysis.kernels import friction_over_a_period
from simulators.analysis.site_forces import Series
from tests.reference.friction import jenkins_over_a_period
from tests.simulators.analysis.rigs import every_site


def test_friction_over_a_period_is_that_of_the_reference() -> None:
    rng = np.random.default_rng(3)
    series = Series(4, 128)
    stiffness, slip = rng.uniform(1.0, 5.0, 7), rng.uniform(0.1, 3.0, 7)
    deflection = series.basis @ rng.standard_normal(series.size)
    force, tangent = np.empty(128), np.empty((128, series.size))
    elements = np.array([stiffness, stiffness * slip])
    friction_over_a_period(elements, deflection, series.basis, np.empty(7), np.empty(7, np.int64), force, tangent)
    expected, slope = jenkins_over_a_period(deflection, series.basis, stiffness, slip)
    assert np.max(np.abs(expected)) > 1.0
    np.testing.assert_allclose(force, expected, atol=1e-12)
    np.testing.assert_allclose(tangent, slope, atol=1e-12)


def test_series_go_back_and_forth() -> None:
    series = Series(5, 32)
    harmonics = series.to_complex(np.random.default_rng(1).standard_normal((2, series.size)))
    theta = 2 * np.pi * np.arange(32) / 32
    samples = np.real(harmonics @ np.exp(1j * np.outer(np.arange(6), theta)))
    np.testing.assert_allclose(series.waveforms(harmonics), samples, atol=1e-12)
    np.testing.assert_allclose(series.to_complex(samples @ series.projection.T), harmonics, atol=1e-12)


@pytest.mark.parametrize("held", ["force", "force-rms", "response", "voltage"])
@pytest.mark.parametrize("at", ["lag", "frequency"])
def test_jacobian_agrees_with_finite_differences(held: str, at: str) -> None:
    balance = Balance(every_site(), 4, 128)
    conditions = Conditions(held, 0.4, at, -1.5 if at == "lag" else 150.0)
    y = balance.linear_start(Conditions("force", 0.3, "lag", -np.pi / 2), 153.0)
    motion = np.random.default_rng(1).standard_normal(y.size - 2)
    y[:-2] += 1e-5 * motion
    jacobian = balance.residual(y, conditions)[1]
    for column in range(y.size):
        step = np.zeros_like(y)
        step[column] = 1e-9 if column < y.size - 2 else 1e-6 * abs(y[column])
        ahead, back = (balance.residual(y + sign * step, conditions)[0] for sign in (1, -1))
        difference = (ahead - back) / (2 * step[column])
        np.testing.assert_allclose(jacobian[:, column], difference, atol=2e-5 * np.max(np.abs(difference)))
