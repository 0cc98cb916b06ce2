"""What a linear model leaves unexplained, and the starts that are taken from it."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from identification import Features, IdentificationError, PnlssModel, pnlss_errors
from identification.experiments.experiment import Experiment
from identification.models.pnlss.saturating_starts import linear_residual, saturating_starts
from tests.identification.models.pnlss.multisines import (
    RATE_HZ,
    channels,
    linear_model,
    measured,
    multisine,
    oscillator,
)
from tests.refused import refused


def recorded(outputs: int = 1, samples: int = 90) -> tuple[PnlssModel, Experiment]:
    """A linear model, and a record that it does not explain."""
    model = linear_model(oscillator(outputs=outputs))
    random = np.random.default_rng(3)
    force, motions = channels(1, outputs)
    data = Experiment(
        inputs=random.normal(size=(1, samples)),
        outputs=random.normal(size=(outputs, samples)),
        sample_rate_hz=RATE_HZ,
        input_channels=force,
        output_channels=motions,
    )
    return model, data


@pytest.mark.parametrize("outputs", [1, 2])
def test_disturbances_are_those_of_a_least_squares_problem_over_all_samples(outputs: int) -> None:
    model, data = recorded(outputs)
    found = linear_residual(model, [data], 1e-2)
    run = model.simulate(data.inputs)
    moved = 1e-2 * np.mean(run.states**2, axis=1)
    noise = np.mean((data.outputs - run.outputs) ** 2, axis=1)
    spread = scipy.linalg.solve_discrete_are(model.a.T, model.c.T, np.diag(moved), np.diag(noise))
    n, samples = 2, data.inputs.shape[1]
    # Unknowns: the state before the first sample, and w of each sample; x is linear in them.
    x = np.zeros((samples + 1, n, n + n * samples))
    x[0, :, :n] = np.eye(n)
    rest = np.zeros((samples + 1, n))
    for k in range(samples):
        x[k + 1] = model.a @ x[k]
        x[k + 1, :, n + n * k : n + n * (k + 1)] += np.eye(n)
        rest[k + 1] = model.a @ rest[k] + model.b @ data.inputs[:, k]
    rows = [np.linalg.solve(np.linalg.cholesky(spread), x[0])]
    aims = [np.zeros(n)]
    for k in range(samples):
        rows += [(model.c @ x[k]) / np.sqrt(noise)[:, None]]
        aims += [(data.outputs[:, k] - model.c @ rest[k] - model.d @ data.inputs[:, k]) / np.sqrt(noise)]
    rows += [np.hstack([np.zeros((n * samples, n)), np.diag(np.tile(1.0 / np.sqrt(moved), samples))])]
    aims += [np.zeros(n * samples)]
    solved = np.linalg.lstsq(np.vstack(rows), np.concatenate(aims), rcond=None)[0]
    expected = solved[n:].reshape(samples, n).T
    states = rest[:-1].T + (x[:-1] @ solved).T
    kept = found.weight.size
    assert kept == samples - 50
    np.testing.assert_allclose(found.disturbance, expected[:, :kept], rtol=0.0, atol=1e-9 * np.max(np.abs(expected)))
    np.testing.assert_allclose(found.variables[:n], states[:, :kept], rtol=0.0, atol=1e-9 * np.max(np.abs(states)))
    np.testing.assert_array_equal(found.variables[n:], data.inputs[:, :kept])


def saturating() -> tuple[PnlssModel, PnlssModel]:
    """A linear model, and the same with two saturating features."""
    linear = linear_model(oscillator())
    features = Features.saturating([[0.6, 0.2, 0.0, 0.3], [-0.3, 0.9, 0.0, 0.0]])
    return linear, replace(linear.with_features(features), e=np.array([[-0.1, 0.05], [-0.05, 0.02]]))


def test_starts_explain_most_of_what_the_linear_model_leaves_before_any_fit() -> None:
    linear, exact = saturating()
    training = [measured(exact, multisine(0))]
    none = Features.none(2, 1)
    starts = saturating_starts(linear, training, none, none, (6, 0), np.random.default_rng(0), 4)
    left = [pnlss_errors(model, training).overall[0] for model in starts]
    before = pnlss_errors(linear, training).overall[0]
    assert len(starts) == 4
    assert max(left) < 0.4 * before
    assert left == sorted(left)
    assert starts[0].state_features.weights.shape == (6, 4)


def test_features_that_are_given_stay_ahead_of_the_saturating_ones_and_begin_at_zero() -> None:
    linear, exact = saturating()
    own, other = Features.monomials(2, 1, (3,)), Features.saturating([[1.0, 0.0, 0.0, 0.0]])
    start, *_ = saturating_starts(
        linear, [measured(exact, multisine(0))], own, other, (3, 2), np.random.default_rng(0), 4
    )
    np.testing.assert_array_equal(start.state_features.exponents, own.exponents)
    np.testing.assert_array_equal(start.output_features.weights[0], other.weights[0])
    assert (start.state_features.count, start.output_features.count) == (own.count + 3, 3)
    assert not np.any(start.e[:, : own.count])
    assert not np.any(start.f[:, :1])


def test_no_start_is_worse_than_the_linear_model_even_where_the_regression_is_unstable() -> None:
    """A negative spring on a nearly undamped oscillator: what regression finds may grow without bounds."""
    linear = linear_model(oscillator(damping=2e-4))
    data = [measured(linear_model(oscillator(frequency_hz=80.0, damping=0.05)), multisine(0))]
    before = pnlss_errors(linear, data).overall[0]
    none = Features.none(2, 1)
    for start in saturating_starts(linear, data, none, none, (4, 4), np.random.default_rng(0), 12):
        assert pnlss_errors(start, data).overall[0] <= before * (1.0 + 1e-12)


def test_starts_exist_without_a_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    def no(*_: object) -> object:
        raise np.linalg.LinAlgError("no")

    monkeypatch.setattr(scipy.linalg, "solve_discrete_are", no)
    linear, exact = saturating()
    data = [measured(exact, multisine(0))]
    with refused(IdentificationError, "its-kalman-filter-could-not-be", field="linear"):
        linear_residual(linear, data, 1e-2)
    none = Features.none(2, 1)
    starts = saturating_starts(linear, data, none, none, (3, 1), np.random.default_rng(0), 4)
    assert all(np.isfinite(pnlss_errors(start, data).overall[0]) for start in starts)
