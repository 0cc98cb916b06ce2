from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification import Experiment, FitHistory, FitSettings, IdentificationError, PnlssModel, fit_pnlss
from tests.identification.models.pnlss.systems import disturbed, experiment, nonlinear_system, periodic_experiment
from tests.refused import refused

SYSTEM = nonlinear_system(2, 1, 1)
START = disturbed(SYSTEM)
ONE = experiment(SYSTEM, 300)
DOUBLE = nonlinear_system(2, 2, 1)


def driven_alike() -> Experiment:
    one = experiment(DOUBLE, 400)
    return replace(one, inputs=np.vstack([one.inputs[0], 2.0 * one.inputs[0]]))


@pytest.mark.parametrize(
    ("start", "experiments", "validation", "settings", "message"),
    [
        (START, [], [], {}, {"says": "none-given", "field": "experiments"}),
        (
            START,
            [experiment(nonlinear_system(2, 1, 2), 300)],
            [],
            {},
            {"says": "outputs-are-the-model-has", "where": "experiments[0] (noise 1)"},
        ),
        (
            START,
            [ONE],
            [experiment(DOUBLE, 300)],
            {},
            {"says": "inputs-are-the-model-has", "where": "validation[0] (noise 1)"},
        ),
        (
            START,
            [replace(ONE, sample_rate_hz=50.0)],
            [],
            {},
            {"says": "sampled-at-hz-the-model-is", "where": "experiments[0] (noise 1)"},
        ),
        (
            START,
            [experiment(SYSTEM, 40)],
            [],
            {},
            {"says": "values-of-outputs-count-fewer-than", "field": "experiments"},
        ),
        (START, [replace(ONE, inputs=0.0 * ONE.inputs)], [], {}, {"says": "input-is-zero-throughout"}),
        (START, [replace(ONE, outputs=0.0 * ONE.outputs)], [], {}, {"says": "output-is-zero-throughout"}),
        (
            START,
            [ONE],
            [replace(ONE, outputs=0.0 * ONE.outputs)],
            {},
            {"says": "output-is-zero-throughout-the-validation"},
        ),
        (
            START,
            [experiment(SYSTEM, 300, seed=2), ONE],
            [replace(ONE, inputs=np.array(ONE.inputs), name="again")],
            {},
            {"says": "has-the-samples-of-experiments-validate", "where": "validation[0] (again)"},
        ),
        (disturbed(DOUBLE), [driven_alike()], [], {}, {"says": "one-is-combination-of-the-others"}),
        (
            replace(START, a=1.5 * START.a),
            [ONE],
            [],
            {},
            {"field": "start", "allowed": "a model that is stable and in the units of the channels"},
        ),
        (
            replace(START, c=1e9 * START.c),
            [ONE],
            [],
            {},
            {"says": "its-outputs-reach-times-those-of", "field": "start"},
        ),
        (
            START,
            [ONE],
            [],
            {"band_hz": (1.0, 2.0)},
            {"says": "is-not-periodic-and-cannot-be", "where": "experiments[0] (noise 1)"},
        ),
        (
            START,
            [replace(ONE, period_samples=150)],
            [],
            {"band_hz": (1.0, 20.0)},
            {"says": "experiments-noise-channel-periods-and-of"},
        ),
        (
            START,
            [periodic_experiment(SYSTEM, 100)],
            [],
            {"band_hz": (1.1, 1.9)},
            {"says": "no-frequency-line-that-counts", "where": "experiments[0] (periodic 1)"},
        ),
        (
            START,
            [periodic_experiment(SYSTEM, 100)],
            [],
            {"line_weights": ((0, 1, 1), (9, 1, 1))},
            {"says": "have-weights", "field": "line_weights"},
        ),
    ],
)
def test_data_and_models_that_cannot_be_used_are_named(
    start: PnlssModel,
    experiments: list[Experiment],
    validation: list[Experiment],
    settings: dict[str, Any],
    message: str,
) -> None:
    with refused(IdentificationError, **message) as caught:
        fit_pnlss(start, experiments, validation=validation, settings=FitSettings(**settings))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"iterations": -1}, {"field": "iterations", "value": -1, "allowed": "0 and above"}),
        ({"patience": -1}, {"field": "patience", "value": -1}),
        ({"least_gain": -1e-9}, {"field": "least_gain", "value": -1e-09}),
        ({"least_gain": 1.0}, {"field": "least_gain", "value": 1.0}),
        ({"tolerance": -1e-9}, {"field": "tolerance", "value": -1e-09}),
        ({"tolerance": 1.0}, {"field": "tolerance", "value": 1.0}),
        ({"outputs": "peak"}, {"field": "outputs", "value": "peak", "allowed": "rms, none"}),
        ({"ridge": float("nan")}, {"field": "ridge"}),
        ({"ridge": -1e-9}, {"field": "ridge", "value": -1e-09}),
        ({"ridge": float("inf")}, {"says": "inf", "field": "ridge"}),
        ({"damping": 0.0}, {"field": "damping", "value": 0.0}),
        ({"damping": float("inf")}, {"says": "inf", "field": "damping"}),
        ({"truncation": -1e-9}, {"field": "truncation", "value": -1e-09}),
        ({"truncation": 1.0}, {"field": "truncation", "value": 1.0, "allowed": "0 and above, below 1"}),
        ({"band_hz": (20.0, 10.0)}, {"field": "band_hz"}),
        ({"line_weights": ((2.0, 1.0), (1.0, 1.0))}, {"says": "need-rows", "field": "line_weights"}),
        ({"line_weights": ((1.0, -1.0),)}, {"says": "need-rows", "field": "line_weights"}),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], message: str) -> None:
    with refused(IdentificationError, **message):
        FitSettings(**settings)


@pytest.mark.parametrize(
    "settings",
    [
        dict.fromkeys(("iterations", "patience"), 0),
        dict.fromkeys(("least_gain", "tolerance", "ridge", "truncation"), 0.0),
        dict.fromkeys(("least_gain", "tolerance", "truncation"), 0.999),
        {"ridge": 10.0, "damping": 10.0},
    ],
)
def test_settings_at_the_edges_of_their_ranges_are_allowed(settings: dict[str, Any]) -> None:
    found = FitSettings(**settings)
    assert all(getattr(found, name) == value for name, value in settings.items())


def test_a_fit_is_resumed_with_its_own_start_and_experiments_alone() -> None:
    fit = fit_pnlss(START, [ONE], settings=FitSettings(iterations=1))
    with refused(IdentificationError, "its-has-shape-that-of-the", field="resume"):
        fit_pnlss(disturbed(nonlinear_system(2, 1, 1, degrees=(3,))), [ONE], resume=fit)
    with refused(IdentificationError, "has-estimated-initial-states-the-experim", field="resume"):
        fit_pnlss(START, [replace(ONE, initial_state="estimated")], resume=fit)
    other = [experiment(SYSTEM, 300, seed=2)]
    with refused(IdentificationError, "was-fitted-with-no-validation-data", field="resume"):
        fit_pnlss(START, [ONE], validation=other, resume=fit)
    chosen = fit_pnlss(START, [ONE], validation=other, settings=FitSettings(iterations=1))
    with refused(IdentificationError, "was-fitted-with-validation-data-now", field="resume"):
        fit_pnlss(START, [ONE], resume=chosen)


def test_the_best_iterate_is_one_that_has_an_error() -> None:
    one = np.ones(3)
    history = FitHistory(training_error=one, validation_error=[np.nan, 0.2, 0.1], damping=one, seconds=one)
    assert history.best == 2
