from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification import Experiment, FitHistory, FitSettings, IdentificationError, PnlssModel, fit_pnlss
from tests.identification.models.pnlss.systems import disturbed, experiment, nonlinear_system, periodic_experiment

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
        (START, [], [], {}, "experiments: none given"),
        (
            START,
            [experiment(nonlinear_system(2, 1, 2), 300)],
            [],
            {},
            r"experiments\[0\] \(noise 1\): outputs are y1, y2",
        ),
        (
            START,
            [ONE],
            [experiment(DOUBLE, 300)],
            {},
            r"validation\[0\] \(noise 1\): inputs are u1, u2, the model has u1",
        ),
        (START, [replace(ONE, sample_rate_hz=50.0)], [], {}, "sampled at 50 Hz, the model is of 100 Hz; resample"),
        (START, [experiment(SYSTEM, 40)], [], {}, "40 values of outputs count, fewer than the 57 parameters"),
        (START, [replace(ONE, inputs=0.0 * ONE.inputs)], [], {}, "input 'u1': is zero throughout"),
        (START, [replace(ONE, outputs=0.0 * ONE.outputs)], [], {}, "output 'y1': is zero throughout"),
        (
            START,
            [ONE],
            [replace(ONE, outputs=0.0 * ONE.outputs)],
            {},
            "output 'y1': is zero throughout the validation data",
        ),
        (
            START,
            [experiment(SYSTEM, 300, seed=2), ONE],
            [replace(ONE, inputs=np.array(ONE.inputs), name="again")],
            {},
            r"validation\[0\] \(again\): has the samples of experiments\[1\]",
        ),
        (disturbed(DOUBLE), [driven_alike()], [], {}, "one is a combination of the others"),
        (replace(START, a=1.5 * START.a), [ONE], [], {}, "start: .*needs a model that is stable"),
        (replace(START, c=1e9 * START.c), [ONE], [], {}, "start: its outputs reach .* times those of"),
        (START, [ONE], [], {"band_hz": (1.0, 2.0)}, r"experiments\[0\] \(noise 1\): is not periodic"),
        (
            START,
            [replace(ONE, period_samples=150)],
            [],
            {"band_hz": (1.0, 20.0)},
            r"'experiments\[0\] \(noise 1\)', channel 'u1': periods 1 and 2 of 150 samples differ",
        ),
        (START, [periodic_experiment(SYSTEM, 100)], [], {"band_hz": (1.1, 1.9)}, "no frequency line that counts"),
        (START, [periodic_experiment(SYSTEM, 100)], [], {"line_weights": ((0, 1, 1), (9, 1, 1))}, "have 2 weights"),
    ],
)
def test_data_and_models_that_cannot_be_used_are_named(
    start: PnlssModel,
    experiments: list[Experiment],
    validation: list[Experiment],
    settings: dict[str, Any],
    message: str,
) -> None:
    with pytest.raises(IdentificationError, match=message) as caught:
        fit_pnlss(start, experiments, validation=validation, settings=FitSettings(**settings))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"iterations": -1}, "iterations: is -1, allowed are 0 and above"),
        ({"patience": -1}, "patience: is -1"),
        ({"least_gain": -1e-9}, "least_gain: is -1e-09"),
        ({"least_gain": 1.0}, "least_gain: is 1.0"),
        ({"tolerance": -1e-9}, "tolerance: is -1e-09"),
        ({"tolerance": 1.0}, "tolerance: is 1.0"),
        ({"outputs": "peak"}, "outputs: is peak, allowed are rms, none"),
        ({"ridge": float("nan")}, "ridge: is nan"),
        ({"ridge": -1e-9}, "ridge: is -1e-09"),
        ({"ridge": float("inf")}, "ridge: is inf"),
        ({"damping": 0.0}, "damping: is 0.0"),
        ({"damping": float("inf")}, "damping: is inf"),
        ({"truncation": -1e-9}, "truncation: is -1e-09"),
        ({"truncation": 1.0}, "truncation: is 1.0, allowed are 0 and above, below 1"),
        ({"band_hz": (20.0, 10.0)}, "band_hz: is 20 to 10 Hz"),
        ({"line_weights": ((2.0, 1.0), (1.0, 1.0))}, "line_weights: need rows"),
        ({"line_weights": ((1.0, -1.0),)}, "line_weights: need rows"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(IdentificationError, match=message):
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
    with pytest.raises(IdentificationError, match=r"resume: its e has shape \(2, 16\), that of the start \(2, 10\)"):
        fit_pnlss(disturbed(nonlinear_system(2, 1, 1, degrees=(3,))), [ONE], resume=fit)
    with pytest.raises(IdentificationError, match="resume: has 0 estimated initial states, the experiments 1"):
        fit_pnlss(START, [replace(ONE, initial_state="estimated")], resume=fit)
    other = [experiment(SYSTEM, 300, seed=2)]
    with pytest.raises(
        IdentificationError, match="resume: was fitted with no validation data, now there is validation data"
    ):
        fit_pnlss(START, [ONE], validation=other, resume=fit)
    chosen = fit_pnlss(START, [ONE], validation=other, settings=FitSettings(iterations=1))
    with pytest.raises(
        IdentificationError, match="resume: was fitted with validation data, now there is no validation data"
    ):
        fit_pnlss(START, [ONE], resume=chosen)


def test_the_best_iterate_is_one_that_has_an_error() -> None:
    one = np.ones(3)
    history = FitHistory(training_error=one, validation_error=[np.nan, 0.2, 0.1], damping=one, seconds=one)
    assert history.best == 2
