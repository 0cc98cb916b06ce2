"""Functions of the user in features: found by name, compiled, with a derivative that is given or by finite differences."""

import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest

from identification import Features, FitSettings, IdentificationError, PnlssModel, identify_pnlss, pnlss_errors
from identification.models.pnlss.fitting.fit import fit_pnlss
from identification.models.pnlss.user_functions import user_function
from identification.storage import decode, encode
from tests.identification.models.pnlss.multisines import linear_model, measured, multisine, oscillator
from tests.refused import refused

SOURCE = """
import math

import numba


def soft(s):
    return s / math.sqrt(1.0 + s * s)


def soft_slope(s):
    return (1.0 + s * s) ** -1.5


def wrong_slope(s):
    return 1.0


@numba.njit
def compiled(s):
    return math.atan(s)


@numba.cfunc("float64(float64)")
def c_function(s):
    return math.sin(s)


@numba.cfunc("float64(float64, float64)")
def two(s, t):
    return s + t


def endless(s):
    return math.inf


def texts(s):
    return "text"


NUMBER = 3
"""


@pytest.fixture(autouse=True)
def own_module(tmp_path, monkeypatch):
    name = f"own_features_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(textwrap.dedent(SOURCE))
    monkeypatch.chdir(tmp_path)
    yield name
    sys.modules.pop(name, None)


def features(function: str) -> Features:
    return Features(variables=3, weights=np.array([[0.6, 0.2, 0.1, 0.3]]), functions=(function,))


@pytest.mark.parametrize(
    ("name", "of", "slope"),
    [
        ("soft", lambda s: s / np.sqrt(1.0 + s**2), lambda s: (1.0 + s**2) ** -1.5),
        ("soft:soft_slope", lambda s: s / np.sqrt(1.0 + s**2), lambda s: (1.0 + s**2) ** -1.5),
        ("compiled", np.arctan, lambda s: 1.0 / (1.0 + s**2)),
        ("c_function", np.sin, np.cos),
    ],
)
def test_values_and_derivatives_are_those_of_the_function(own_module, name, of, slope):
    own = features(f"{own_module}:{name}")
    v = np.random.default_rng(1).normal(size=(3, 20))
    s = own.weights[0, :3] @ v + 0.3
    np.testing.assert_allclose(own.values(v)[0], of(s) - of(0.3), rtol=1e-13, atol=1e-15)
    expected = slope(s) * own.weights[0, :3, None]
    exact = ":" in name
    np.testing.assert_allclose(own.derivatives(v)[0], expected, rtol=1e-13 if exact else 1e-9, atol=1e-9 * (not exact))


@pytest.mark.parametrize(("name", "of"), [("square", np.square), ("cube", lambda s: s**3)])
def test_squares_and_cubes_of_weighted_sums_are_there_without_code(name, of):
    own = features(name)
    v = np.random.default_rng(1).normal(size=(3, 20))
    s = own.weights[0, :3] @ v + 0.3
    np.testing.assert_allclose(own.values(v)[0], of(s) - of(0.3), rtol=1e-13)
    step = 1e-6
    for j in range(3):
        moved = np.eye(3)[j][:, None] * step
        both = (own.values(v + moved) - own.values(v - moved)) / (2 * step)
        np.testing.assert_allclose(own.derivatives(v)[:, j], both, rtol=1e-8, atol=1e-8)


def with_function(name: str) -> PnlssModel:
    linear = linear_model(oscillator())
    own = Features(variables=3, weights=np.array([[0.6, 0.2, 0.0, 0.3]]), functions=(name,))
    return replace(linear.with_features(own), e=np.array([[-0.1], [-0.05]]))


def test_a_fit_finds_the_weights_of_a_users_function(own_module):
    exact = with_function(f"{own_module}:soft")
    training = [measured(exact, multisine(seed)) for seed in range(2)]
    start = replace(
        exact,
        a=exact.a * 0.99,
        e=0.7 * exact.e,
        state_features=replace(exact.state_features, weights=1.2 * exact.state_features.weights),
    )
    fit = fit_pnlss(start, training, settings=FitSettings(iterations=30))
    assert fit.history.training_error[0] > 0.05
    assert pnlss_errors(fit.model, [measured(exact, multisine(9))]).overall[0] < 1e-6


def test_starts_are_found_for_a_users_function_too(own_module):
    name = f"{own_module}:soft"
    exact = with_function(name)
    training = [measured(exact, multisine(seed)) for seed in range(2)]
    found = identify_pnlss(training, states=2, saturating=(2, 0), function=name, settings=FitSettings(iterations=40))
    assert found.model.state_features.functions == (name, name)
    assert found.training_error < 1e-3
    arrays, attributes = encode(found)
    assert decode(type(found), arrays, attributes).model.state_features.functions == (name, name)


def test_nothing_is_imported_before_the_features_are_evaluated(tmp_path, monkeypatch):
    (tmp_path / "leaves_traces.py").write_text(
        "from pathlib import Path\nPath('trace').touch()\ndef g(s):\n    return s\n"
    )
    monkeypatch.chdir(tmp_path)
    own = features("leaves_traces:g")
    assert own.names(2) == ("leaves_traces:g 1",)
    assert own.scaled(np.ones(3))[0].functions == ("leaves_traces:g",)
    assert not (tmp_path / "trace").exists()
    own.values(np.zeros((3, 1)))
    assert (tmp_path / "trace").exists()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nowhere", {"says": "cannot-be-imported-nowhere-allowed-is"}),
        ("two", {"says": "has-another-signature-allowed-is-float"}),
        ("endless", {"says": "is-at-must-be-finite"}),
        ("texts", {"says": "cannot-be-compiled-as-function-of"}),
        ("NUMBER", {"says": "cannot-be-compiled-as-function-of"}),
        ("soft:wrong_slope", {"says": "its-derivative-is-at-the-function"}),
    ],
)
def test_what_is_no_function_of_one_number_is_refused_by_name(own_module, name, said):
    with refused(IdentificationError, **said):
        user_function(f"{own_module}:{name}")


def test_a_name_that_is_no_name_is_refused_at_once():
    with refused(IdentificationError, "are-my-function-or-module-name", field="functions"):
        features("my function")
    with refused(IdentificationError, "cannot-be-imported-no-module-named"):
        features("no_such_module:g").values(np.zeros((3, 1)))
