import numpy as np
import pytest

from tests.reference.friction import jenkins_over_a_period
from tests.reference.parameters import ONE_SIDED
from vibrolock.arrays import Float

K, SLIP = ONE_SIDED.jenkins_k, ONE_SIDED.jenkins_slip
THETA = 2 * np.pi * np.arange(1024) / 1024
BASIS = np.column_stack([np.ones_like(THETA), np.cos(THETA), -np.sin(THETA)])


def parallel(delta: Float, basis: Float = BASIS) -> Float:
    """Sum of the Jenkins forces themselves, without the stuck part that the site adds."""
    return np.asarray(K.sum() * delta - jenkins_over_a_period(delta, basis, K, SLIP)[0])


def virgin(delta: Float) -> Float:
    """First loading from rest."""
    return np.asarray(np.sum(K * np.minimum(delta[:, None], SLIP), axis=1))


def test_a_stuck_clamp_adds_nothing() -> None:
    assert np.max(np.abs(jenkins_over_a_period(0.99 * SLIP[0] * np.cos(THETA), BASIS, K, SLIP)[0])) < 1e-15


@pytest.mark.parametrize("amplitude", [5e-4, 1e-3, 1.7e-3, 4e-3])
def test_the_closed_loop_is_masing(amplitude: float) -> None:
    force, top = parallel(amplitude * np.cos(THETA)), virgin(np.array([amplitude]))
    down = slice(0, 513)
    swing = amplitude * (1 - np.cos(THETA[down]))
    np.testing.assert_allclose(force[down], top - 2 * virgin(swing / 2), atol=1e-12)
    np.testing.assert_allclose(force[512:], -force[:512], atol=1e-12)


@pytest.mark.parametrize("amplitude", [5e-4, 1.7e-3, 4e-3])
def test_the_loop_dissipates_four_times_stiffness_slip_and_overshoot(amplitude: float) -> None:
    force = parallel(amplitude * np.cos(THETA))
    quadrature = -2 * np.mean(force * np.sin(THETA))
    loss = 4 * np.sum(K * SLIP * np.maximum(amplitude - SLIP, 0.0))
    assert np.pi * amplitude * quadrature == pytest.approx(loss, rel=2e-4)


def test_a_mean_shift_beyond_the_first_slip_leaves_the_loop_shape_alone() -> None:
    centred, shifted = parallel(1e-3 * np.cos(THETA)), parallel(1e-3 * np.cos(THETA) + 5e-4)
    np.testing.assert_allclose(shifted - shifted.mean(), centred - centred.mean(), atol=1e-12)


def test_the_derivative_agrees_with_finite_differences() -> None:
    at = np.array([2e-4, 1.3e-3, 4e-4])
    tangent = jenkins_over_a_period(BASIS @ at, BASIS, K, SLIP)[1]
    for column in range(3):
        step = np.zeros(3)
        step[column] = 1e-10
        ends = [jenkins_over_a_period(BASIS @ (at + sign * step), BASIS, K, SLIP)[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / 2e-10
        # where an element starts to slide the force has a kink, at a few samples only
        agree = np.abs(tangent[:, column] - difference) < 1e-5 * K.sum()
        assert np.mean(agree) > 0.98
