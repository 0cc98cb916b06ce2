"""The static force of the support in periodic experiments: the mean alone, at once, with exact derivatives."""

import numpy as np
import pytest

from identification.experiments.experiment import Experiment
from identification.models.structured.nudging import Nudging, periods_of
from identification.models.structured.parameters import Parameters
from tests.identification.models.structured.models import FORCE, OUTPUTS, RATE_HZ, beam, multisine

PERIOD = 2000


def experiment(model, rms_n: float, ahead: int = 1) -> Experiment:
    """A periodic experiment whose outputs are those of the model without its support, which lead near enough."""
    u = np.tile(multisine(rms_n, 3, PERIOD), (1, ahead + 1))
    return Experiment(
        inputs=u,
        outputs=beam(support_n_m=0.0).simulate(u).outputs,
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=OUTPUTS,
        counted_from=ahead * PERIOD,
        period_samples=PERIOD,
    )


def test_the_force_is_that_of_the_mean_displacement_and_changes_no_line_of_the_period():
    """Against the same beam without a support, under a force with that mean; without sliders that would remember the way."""
    elements = beam().elements[:1]
    model = beam(support_n_m=3000.0, elements=elements)
    found = model.simulate_experiment(experiment(model, 3.0))
    mean = float(np.mean(model.input_shapes[:, 0] @ found.displacement[:, -PERIOD:]))
    static = -model.support_largest_n * np.tanh(model.support_n_m * mean / model.support_largest_n)
    assert abs(static) > 0.05  # newtons: the spring of the beam is not symmetric
    pushed = np.tile(multisine(3.0, 3, PERIOD), (1, 12)) + static
    alone = beam(support_n_m=0.0, elements=elements).simulate(pushed)
    difference = found.displacement[:, -PERIOD:] - alone.displacement[:, -PERIOD:]
    assert np.linalg.norm(difference) < 2e-3 * np.linalg.norm(alone.displacement[:, -PERIOD:])
    without = beam(support_n_m=0.0, elements=elements).simulate_experiment(experiment(model, 3.0))
    moved = without.displacement[:, -PERIOD:] - alone.displacement[:, -PERIOD:]
    assert np.linalg.norm(moved) > 10.0 * np.linalg.norm(difference)


def test_derivatives_with_a_held_force_are_those_of_finite_differences():
    start = beam(steps=2, elements=beam().elements[:1])
    parameters = Parameters(start, (0,), True)
    vector, u = parameters.vector(start), np.tile(multisine(1.0, 4, 200), (1, 4))
    velocity = 1e-3 * np.random.default_rng(5).standard_normal((2, u.shape[1]))
    signals = np.vstack([u, velocity])
    nudging = Nudging(np.array([3.0, 9.0]), np.array([1.0, 2.0]), signals, start.steps, until=400, period=200)
    _, exact = parameters.derivatives(parameters.model(vector), u, 600, nudging)
    for column, name in enumerate(parameters.names):
        step = 1e-5 * max(abs(vector[column]), 1e-1)
        moves = []
        for sign in (-1.0, 1.0):
            moved = vector.copy()
            moved[column] += sign * step
            moves.append(parameters.derivatives(parameters.model(moved), u, 600, nudging)[0])
        differences = (moves[1] - moves[0]) / (2.0 * step)
        size = np.linalg.norm(exact[..., column])
        assert np.linalg.norm(differences - exact[..., column]) <= 5e-5 * size + 1e-9, name


@pytest.mark.parametrize(("first", "last"), [(0, 50), (0, 400), (130, 131)])
def test_stretches_end_where_periods_begin(first, last):
    found = list(periods_of(first, last, 350, 100))
    assert [one[0] for one in found[1:]] == [one[1] for one in found[:-1]]
    assert (found[0][0], found[-1][1]) == (first, last)
    assert all((begin - 350) % 100 == 0 for begin, _ in found[1:])
    assert all(end - begin <= 100 for begin, end in found)
