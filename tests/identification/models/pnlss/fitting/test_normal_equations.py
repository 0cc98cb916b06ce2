"""Normal equations against derivatives by complex steps through a simulation in plain numpy, in one piece and in several."""

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from identification import PnlssModel
from identification.fitting.threads import available_threads, threads
from identification.models.pnlss.fitting import normal_equations as module
from identification.models.pnlss.fitting.normal_equations import normal_equations
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import Record, records_of
from tests.identification.models.pnlss.systems import disturbed, experiment, nonlinear_system
from vibrolock.arrays import Complex, Float


def features(model: PnlssModel, v: Complex, weights: Complex) -> Complex:
    """(x, u, phi) of variables complex[n_vectors, n_variables], weights complex[n_vectors, n_functions, n_variables + 1]."""
    padded = np.concatenate([v, np.ones((len(v), 1))], axis=1)
    monomials = np.prod(padded[:, model.state_features.table.factors], axis=2)
    sums = np.einsum("pfj,pj->pf", weights[:, :, :-1], v) + weights[:, :, -1]
    return np.concatenate([v, monomials, np.tanh(sums) - np.tanh(weights[:, :, -1])], axis=1)


def errors(parameters: Parameters, vectors: Complex, record: Record, weights: Float) -> Complex:
    """complex[n_vectors, counted, n_outputs], weighted errors with each vector of parameters."""
    model, many, n = parameters.start, len(vectors), parameters.start.states
    linear, inner_state, inner_output, begins, own = np.split(vectors, parameters.ends[:-1], axis=1)
    state, output = linear.reshape(many, n, -1), own.reshape(many, len(weights), -1)
    inner = [part.reshape(many, -1, n + len(model.inputs) + 1) for part in (inner_state, inner_output)]
    x = begins.copy() if record.place is not None else np.zeros((many, n), complex)
    found = []
    for u, y in zip(record.u, record.y, strict=True):
        v = np.concatenate([x, np.broadcast_to(u, (many, len(u)))], axis=1)
        found.append(weights * (np.einsum("pof,pf->po", output, features(model, v, inner[1])) - y))
        x = np.einsum("pif,pf->pi", state, features(model, v, inner[0]))
    return np.array(found)[record.counted_from :].swapaxes(0, 1)


@pytest.mark.parametrize(
    ("states", "inputs", "outputs", "saturating"),
    [(2, 1, 1, 0), (2, 1, 1, 1), (3, 2, 2, 2), (2, 1, 3, 1), (4, 1, 4, 0)],
)
@pytest.mark.parametrize("estimated", [False, True])
def test_they_are_products_of_derivatives_by_complex_steps(
    states: int,
    inputs: int,
    outputs: int,
    saturating: int,
    estimated: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = nonlinear_system(states, inputs, outputs, saturating=saturating)
    begin = np.linspace(0.2, 0.4, states) if estimated else None
    one = replace(experiment(system, 160, begin=begin, noise=0.1), counted_from=30)
    (record,) = records_of([one], np.ones(inputs), np.ones(outputs))
    weights, parameters = np.linspace(1.0, 2.0, outputs), Parameters(system, int(estimated))
    vector = parameters.vector(disturbed(system, 0.05), np.full((int(estimated), states), 0.3))
    vector = np.where(vector == 0.0, 1e-3, vector)
    stepped = errors(parameters, vector + 1e-30j * np.eye(vector.size), record, weights)
    rows = (stepped.imag / 1e-30).reshape(vector.size, -1)

    hessian, gradient = rows @ rows.T, rows @ stepped[0].real.ravel()
    size = np.sqrt(np.diag(hessian))
    assert np.all(size > 0.0)
    monkeypatch.setattr(module, "_SHORTEST", 30)
    for pieces in (1, 2, 3):
        found = normal_equations(parameters, vector, [record], weights, pieces)
        np.testing.assert_allclose(found.hessian / np.outer(size, size), hessian / np.outer(size, size), atol=1e-12)
        np.testing.assert_allclose(found.gradient / size, gradient / size, atol=1e-11)


def test_a_run_that_leaves_all_bounds_in_a_later_piece_gives_no_finite_equations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = nonlinear_system(2, 1, 2)
    one = experiment(system, 4000)
    inputs = one.inputs * np.where(np.arange(4000) < 3000, 1.0, 1e3)
    (record,) = records_of([replace(one, inputs=inputs)], np.ones(1), np.ones(2))
    parameters = Parameters(system)
    found = normal_equations(parameters, parameters.vector(system, np.zeros((0, 2))), [record], np.ones(2), 2)
    assert not np.any(np.isfinite(found.hessian))


def test_the_linear_algebra_keeps_to_one_thread_meanwhile_even_after_an_error() -> None:
    def failing() -> None:
        with threads() as count, threads() as inner:
            assert (count, inner, available_threads()) == (2, 1, 1)
            raise ZeroDivisionError

    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(ZeroDivisionError):
            failing()
        assert available_threads() == 2
