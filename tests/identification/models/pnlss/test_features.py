"""Features of states and inputs against plain arithmetic and finite differences."""

from dataclasses import replace
from math import comb

import numpy as np
import pytest

from identification import Features, IdentificationError, PnlssModel
from identification.models.pnlss.features import FUNCTIONS
from identification.storage import decode, encode
from tests.identification.models.pnlss.systems import nonlinear_system
from tests.refused import refused

VARIABLES = 3


def mixed(limits: tuple[float, ...] = (), function: str = "tanh") -> Features:
    weights = np.random.default_rng(0).normal(size=(2, VARIABLES + 1))
    exponents = Features.monomials(2, 1, (2, 3)).exponents
    of = {"weights": weights, "functions": (function, function)}
    return Features(variables=VARIABLES, exponents=exponents, limits=np.array(limits), **of)


def points(count: int = 40) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(VARIABLES, count))


@pytest.mark.parametrize(("states", "inputs", "degree"), [(2, 1, 2), (2, 1, 3), (4, 1, 3), (3, 2, 5)])
def test_there_are_as_many_monomials_as_combinations_with_repetition(states, inputs, degree):
    assert Features.monomials(states, inputs, [degree]).count == comb(states + inputs + degree - 1, degree)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_values_are_products_of_powers_and_functions_of_weighted_sums_zero_at_rest(function):
    features, v, g = mixed(function=function), points(), FUNCTIONS[function].of
    powers = np.prod(v[None] ** features.exponents[:, :, None], axis=1)
    w, b = features.weights[:, :-1], features.weights[:, -1:]
    np.testing.assert_allclose(features.values(v), np.vstack([powers, g(w @ v + b) - g(b)]), atol=1e-13)
    np.testing.assert_allclose(features.values(np.zeros((VARIABLES, 1))), 0.0, atol=1e-15)  # rounding of g


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("limits", [(), (0.7, 1.1, 0.4)])
def test_derivatives_are_those_of_finite_differences(limits, function):
    features, v, step = mixed(limits, function), points(), 1e-6
    found = features.derivatives(v)
    for j in range(VARIABLES):
        h = np.zeros((VARIABLES, 1))
        h[j] = step
        slope = (features.values(v + h) - features.values(v - h)) / (2.0 * step)
        np.testing.assert_allclose(found[:, j], slope, atol=1e-7)


def test_limits_hold_variables_in_monomials_and_change_nothing_within():
    limits = np.array([0.7, 1.1, 0.4])
    free, held, v = mixed(), mixed(tuple(limits)), points()
    inside = np.all(np.abs(v) <= limits[:, None], axis=0)
    assert 0 < inside.sum() < inside.size
    np.testing.assert_array_equal(held.values(v)[:, inside], free.values(v)[:, inside])
    count = len(free.exponents)
    clipped = np.clip(v, -limits[:, None], limits[:, None])
    np.testing.assert_allclose(held.values(v)[:count], free.values(clipped)[:count])


def test_features_of_scaled_variables_are_these_but_for_their_factors():
    features, v, scale = mixed((0.7, 1.1, 0.4)), points(), np.array([2.0, 0.1, 30.0])
    other, factors = features.scaled(scale)
    np.testing.assert_allclose(factors[:, None] * other.values(v / scale[:, None]), features.values(v), rtol=1e-10)


def test_a_model_keeps_the_names_of_its_functions_in_files(monkeypatch):
    monkeypatch.setitem(FUNCTIONS, "twin", FUNCTIONS["tanh"])
    model = nonlinear_system(2, 1, 1, degrees=(2,), saturating=2)
    assert not any("functions" in name for name in encode(model)[1])  # all are tanh, as before there were others
    other = replace(model.state_features, functions=("tanh", "twin"))
    arrays, attributes = encode(replace(model, state_features=other))
    again = decode(PnlssModel, arrays, attributes)
    assert again.state_features.functions == ("tanh", "twin")
    assert again.output_features.functions == ()
    assert again.state_features.names(2)[-2:] == ("tanh 1", "twin 2")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Features.monomials(2, 1, [1]), {"field": "degrees", "allowed": "2 and above"}),
        (lambda: Features.monomials(2, 1, [2], of=[3]), {"says": "variable", "field": "of", "allowed": "0 to 2"}),
        (
            lambda: Features(variables=2, exponents=np.array([[1, 1], [1, 1]])),
            {"says": "hold-monomial-twice", "field": "exponents"},
        ),
        (lambda: Features(variables=2, exponents=np.array([[1, 0]])), {"says": "degree-below", "field": "exponents"}),
        (lambda: mixed(function="tank"), {"says": "are-tank-tank-for-rows-of", "field": "functions"}),
        (
            lambda: Features(variables=1, weights=np.ones((2, 2)), functions=("tanh",)),
            {"says": "are-tanh-for-rows", "field": "functions"},
        ),
        (lambda: mixed((1.0, 0.0, 1.0)), {"says": "values-above-zero", "field": "limits"}),
        (lambda: mixed().values(np.zeros((2, 1))), {"field": "v", "allowed": "3 rows"}),
        (lambda: mixed().values(np.full((3, 1), np.nan)), {"field": "v", "allowed": "finite"}),
    ],
)
def test_what_is_no_feature_is_refused_by_name(make, said):
    with refused(IdentificationError, **said):
        make()
