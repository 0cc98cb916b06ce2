"""Minima within bounds, against closed forms and scipy."""

import numpy as np
import pytest
import scipy.optimize

from identification.fitting.bounded_steps import bounded_minimum


def found(residual, jacobian, begin, bounds, tolerance=1e-10, evaluations=50):
    def triangle(x):
        return np.linalg.qr(np.column_stack([jacobian(x), residual(x)]), mode="r")

    return bounded_minimum(
        triangle, lambda x: float(np.sum(residual(x) ** 2)), np.array(begin), bounds, tolerance, evaluations
    )


def rosenbrock(x):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


def of_rosenbrock(x):
    return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


@pytest.mark.parametrize(("largest", "at"), [(2.0, (1.0, 1.0)), (0.5, (0.5, 0.25))])
def test_a_curved_valley_leads_to_its_minimum_or_to_the_bound(largest, at):
    bounds = np.array([-2.0, -2.0]), np.array([largest, 2.0])
    assert found(rosenbrock, of_rosenbrock, (-1.2, 1.0), bounds).vector == pytest.approx(at, abs=1e-5)


def test_numbers_that_belong_at_zero_arrive_there_at_once():
    random = np.random.default_rng(2)
    matrix = random.standard_normal((40, 12)) + 2.0
    right = matrix @ np.where(np.arange(12) % 3, 0.0, 1.0) + 0.5 * random.standard_normal(40)
    exact = scipy.optimize.nnls(matrix, right)[0]
    assert np.sum(exact == 0.0) >= 3
    result = found(
        lambda x: matrix @ x - right, lambda _: matrix, np.ones(12), (np.zeros(12), np.full(12, np.inf)), 1e-9
    )
    np.testing.assert_allclose(result.vector, exact, atol=1e-4)
    assert np.all(result.vector[exact == 0.0] < 1e-12)
    assert result.evaluations < 10
    assert result.ending.message == "the last iteration gained less than 1e-09"


def test_a_fit_says_that_it_was_stopped():
    result = found(rosenbrock, of_rosenbrock, (-1.2, 1.0), (np.full(2, -2.0), np.full(2, 2.0)), evaluations=2)
    assert (result.evaluations, result.ending.message) == (2, "stopped at its limit of 2 iterations")


def test_a_minimum_to_rounding_takes_no_step():
    result = found(rosenbrock, of_rosenbrock, (1.0, 1.0), (np.full(2, -2.0), np.full(2, 2.0)))
    assert result.ending.message == "no step of any damping fits better"
    assert result.vector == pytest.approx((1.0, 1.0))
