"""The loop that fits all models: minima of SciPy's solver, with bounds and without, and why it ends."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from identification.fitting.bounded_steps import BoundedLeastSquares, qr_r
from identification.fitting.levenberg_marquardt import DampingRule, minimise
from identification.fitting.result import MESSAGES, Ending, FitStatus
from identification.fitting.truncated_steps import TruncatedSteps

RULE = DampingRule(first=1e-3, factor=3.0, smallest=1e-12, largest=1e6, worth=0.1)
TIMES = np.linspace(0.0, 2.0, 40)
DATA = 2.0 * np.exp(-1.3 * TIMES) + 0.01 * np.cos(37.0 * TIMES)


def residual(x):
    return x[0] * np.exp(-x[1] * TIMES) - DATA


def jacobian(x):
    decay = np.exp(-x[1] * TIMES)
    return np.stack([decay, -x[0] * TIMES * decay], axis=1)


def cost(x):
    return float(residual(x) @ residual(x))


def settled(iterations, step):
    """End where a step gains next to nothing."""
    if step is not None and step.before - step.cost <= 1e-12 * step.before:
        return Ending.of(FitStatus.CONVERGED, count=1, tolerance=1e-12)
    return Ending.of(FitStatus.ITERATION_LIMIT, limit=50) if iterations == 50 else None


class Truncated:
    cost = staticmethod(cost)

    def linearised(self, x):
        j, r = jacobian(x), residual(x)
        return TruncatedSteps(j.T @ j, j.T @ r, x, cost(x), 1e-13)


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), ([0.0, 1.5], [5.0, 3.0])])
def test_the_minimum_is_that_of_another_solver_and_lies_within_the_bounds(bounds):
    start = np.array([1.0, 2.0])
    least, largest = (np.broadcast_to(bound, 2).astype(float) for bound in bounds)
    problem = BoundedLeastSquares(lambda x: qr_r(np.column_stack([jacobian(x), residual(x)])), cost, (least, largest))
    found = minimise(problem, start, RULE, settled)
    expected = least_squares(residual, start, jacobian, bounds=bounds, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.vector, expected.x, rtol=1e-6)
    assert found.ending.status in (FitStatus.CONVERGED, FitStatus.NO_BETTER_STEP)
    assert found.iterations <= found.evaluations <= 50


def test_a_direction_that_the_data_do_not_determine_does_not_move():
    class Doubled(Truncated):
        """The amplitude is the sum of two numbers."""

        cost = staticmethod(lambda x: cost(np.array([x[0] + x[2], x[1]])))

        def linearised(self, x):
            y = np.array([x[0] + x[2], x[1]])
            j, r = jacobian(y)[:, [0, 1, 0]], residual(y)
            return TruncatedSteps(j.T @ j, j.T @ r, x, cost(y), 1e-10)

    found = minimise(Doubled(), np.array([0.5, 2.0, 0.25]), RULE, settled).vector
    alone = minimise(Truncated(), np.array([0.75, 2.0]), RULE, settled).vector
    assert found[0] + found[2] == pytest.approx(alone[0], rel=1e-6)
    assert found[0] - found[2] == pytest.approx(0.25, abs=1e-6)


def test_whatever_ends_the_iterations_is_a_status_and_what_was_reached_stays():
    def interrupted(step):
        raise KeyboardInterrupt

    class Unbounded(Truncated):
        def linearised(self, x):
            return None

    class Singular(Truncated):
        def linearised(self, x):
            raise np.linalg.LinAlgError

    start = np.array([1.0, 2.0])
    cut = minimise(Truncated(), start, RULE, settled, interrupted)
    assert (cut.ending.status, cut.iterations) == (FitStatus.INTERRUPTED, 1)
    assert cost(cut.vector) < cost(start)
    assert minimise(Unbounded(), start, RULE, settled).ending.status is FitStatus.UNBOUNDED
    assert minimise(Singular(), start, RULE, settled).ending.status is FitStatus.SINGULAR
    limit = minimise(
        Truncated(), start, RULE, lambda n, _: Ending.of(FitStatus.ITERATION_LIMIT, limit=2) if n == 2 else None
    )
    assert (limit.iterations, limit.ending.message) == (2, "stopped at its limit of 2 iterations")
    assert set(MESSAGES) == set(FitStatus)
