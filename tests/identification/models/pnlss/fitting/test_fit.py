import json
import tracemalloc
import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification import FitProgress, FitSettings, IdentificationError, PnlssFit, fit_pnlss, pnlss_errors
from identification.models.pnlss.fitting import checks
from identification.models.pnlss.fitting.checks import needed_bytes
from identification.models.pnlss.fitting.normal_equations import normal_equations
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.problem import Problem
from identification.models.pnlss.fitting.records import records_of
from identification.models.pnlss.fitting.result import FitHistory
from identification.storage import decode, encode
from tests.identification.models.pnlss.systems import (
    disturbed,
    experiment,
    linear_system,
    nonlinear_system,
    periodic_experiment,
)
from tests.refused import refused

NOISE = 1e-3


@pytest.mark.parametrize(("inputs", "outputs", "saturating"), [(1, 1, 0), (1, 4, 0), (2, 2, 0), (1, 2, 1)])
def test_a_known_system_is_recovered_to_the_noise(inputs: int, outputs: int, saturating: int) -> None:
    system = nonlinear_system(2, inputs, outputs, saturating=saturating)
    experiments = [experiment(system, 1500, seed=seed, noise=NOISE) for seed in (1, 2)]
    start = disturbed(system)
    if saturating:
        features = replace(system.state_features, weights=1.1 * system.state_features.weights)
        start = replace(start, state_features=features, e=0.9 * system.e, f=0.9 * system.f)
    fit = fit_pnlss(start, experiments, validation=[experiment(system, 500, seed=3, noise=NOISE)])
    assert fit.history.training_error[0] > 20.0 * NOISE
    assert fit.training_error < 1.02 * NOISE  # all that is left is the noise, less what the parameters take of it
    clean = pnlss_errors(fit.model, [experiment(system, 1000, seed=4)])
    assert np.all(clean.relative < 0.5 * NOISE)  # and of the noise nearly nothing is in the model
    assert fit.linear is None if saturating else fit.linear is not None


def test_the_training_error_is_that_of_a_plain_simulation_and_never_rises() -> None:
    system = nonlinear_system(2, 1, 2)
    experiments = [
        experiment(system, 800, noise=0.01),
        experiment(system, 600, seed=2, level=0.1, noise=0.01).weighted(9.0),
    ]
    fit = fit_pnlss(disturbed(system), experiments, settings=FitSettings(iterations=3))
    scale = np.mean(np.concatenate([e.outputs for e in experiments], axis=1) ** 2, axis=1, keepdims=True)
    runs = [fit.model.simulate(e.inputs).outputs for e in experiments]
    wrong = sum(e.weight * np.sum((y - e.outputs) ** 2 / scale) for e, y in zip(experiments, runs, strict=True))
    whole = sum(e.weight * np.sum(e.outputs**2 / scale) for e in experiments)
    assert fit.training_error == pytest.approx(np.sqrt(wrong / whole), rel=1e-9)
    assert np.all(np.diff(fit.history.training_error) < 0.0)
    assert fit.history.iterations == fit.chosen == 3


def test_ranges_and_names_of_the_training_data_are_in_the_model() -> None:
    system = nonlinear_system(2, 1, 1)
    experiments = [experiment(system, 500, begin=np.array([1.0, -0.5])), experiment(system, 500, seed=2)]
    fit = fit_pnlss(disturbed(system), experiments, settings=FitSettings(iterations=2))
    runs = [
        fit.model.simulate(e.inputs, initial_state=begin)
        for e, begin in zip(experiments, [fit.initial_states[0], None], strict=True)
    ]
    assert max(run.range_use for run in runs) == pytest.approx(1.0, rel=1e-12)
    assert fit.model.training == ("noise 1", "noise 2")


def test_estimated_initial_states_are_found_together_with_the_model() -> None:
    system = nonlinear_system(2, 1, 2)
    begins = [np.array([0.6, 0.3]), np.array([-0.5, 0.2])]
    experiments = [experiment(system, 700, seed=seed, begin=begin) for seed, begin in enumerate(begins)]
    fit = fit_pnlss(disturbed(system), [*experiments, experiment(system, 700, seed=8)])
    assert fit.training_error < 1e-6
    to_system = np.linalg.solve(system.c, fit.model.c)  # two outputs tell the coordinates of two states
    np.testing.assert_allclose(fit.initial_states @ to_system.T, begins, rtol=0.0, atol=1e-4)


def test_the_iterate_with_the_smallest_validation_error_is_chosen_and_patience_ends_a_fit() -> None:
    system = nonlinear_system(2, 1, 1)
    few = [experiment(system, 90, noise=0.3)]
    validation = [experiment(system, 600, seed=3)]
    settings = FitSettings(patience=4, tolerance=0.0)
    fit = fit_pnlss(disturbed(system, 0.001), few, validation=validation, settings=settings)
    errors = fit.history.validation_error
    assert fit.chosen == np.argmin(errors) < fit.history.iterations
    assert fit.history.iterations == fit.chosen + 4
    assert "validation" in fit.message
    assert pnlss_errors(fit.model, validation).overall[0] == pytest.approx(errors[fit.chosen], rel=1e-9)
    assert pnlss_errors(fit.last, validation).overall[0] == pytest.approx(errors[-1], rel=1e-9)


def test_a_fit_that_is_stopped_while_it_pays_says_so_and_one_that_has_arrived_does_not() -> None:
    system = nonlinear_system(2, 1, 1)
    experiments = [experiment(system, 600, noise=0.01)]
    start = disturbed(system, 0.1)
    short = fit_pnlss(start, experiments, settings=FitSettings(iterations=3))
    errors = short.history.training_error
    lowered = 100 * (1 - errors[-1] / errors[-2])
    assert short.limited
    assert short.message == (
        f"stopped at its limit of 3 iterations while still improving: the last one lowered the training error by "
        f"{lowered:.2g} %"
    )
    assert decode(PnlssFit, *encode(short)).limited
    whole = fit_pnlss(start, experiments, resume=short)
    assert not whole.limited
    assert "limit" not in whole.message
    assert whole.training_error < 1.02 * 0.01 < short.training_error
    idle = fit_pnlss(whole.last, experiments, settings=FitSettings(iterations=2))
    assert (idle.limited, idle.message) == (False, "stopped at its limit of 2 iterations")


def test_what_lowers_the_error_by_next_to_nothing_is_no_gain() -> None:
    errors = np.array([1.0, 0.5, 0.4999, 0.4998, 0.4, 0.39999])
    nothing = np.full(errors.size, np.nan)
    past = FitHistory(training_error=errors, validation_error=nothing, damping=nothing, seconds=nothing)
    assert past.since_gain(1e-3) == 1  # the fourth iteration was the last that paid
    assert past.since_gain(0.0) == 0
    assert past.gained(2) == pytest.approx(1 - 0.39999 / 0.4998)
    rising = np.array([np.inf, np.inf, 0.5, 0.6, 0.7, 0.8])
    judged = FitHistory(training_error=errors, validation_error=rising, damping=nothing, seconds=nothing)
    assert judged.since_gain(1e-3) == 3
    assert judged.gained(2) == 0.0
    assert np.isnan(judged.gained(5))


def test_validation_runs_begin_where_their_first_samples_say() -> None:
    system = nonlinear_system(2, 1, 2)
    running = experiment(system, 900, seed=3, begin=np.array([1.0, -1.0]))
    fit = fit_pnlss(disturbed(system), [experiment(system, 900)], validation=[running])
    assert fit.history.validation_error[0] > 1e-2
    assert fit.validation_error < 1e-5


def test_a_resumed_fit_goes_on_as_if_it_had_not_stopped() -> None:
    system = nonlinear_system(2, 1, 2)
    experiments = [experiment(system, 600, noise=0.01, begin=np.array([1.0, 1.0]))]
    start = disturbed(system)
    whole = fit_pnlss(start, experiments, settings=FitSettings(iterations=6, tolerance=0.0))
    half = fit_pnlss(start, experiments, settings=FitSettings(iterations=3))
    arrays, attributes = encode(half)
    restored = decode(PnlssFit, arrays, json.loads(json.dumps(attributes)))
    assert restored.settings == half.settings
    both = fit_pnlss(start, experiments, settings=whole.settings, resume=restored)
    np.testing.assert_allclose(both.history.training_error, whole.history.training_error, rtol=1e-7)
    np.testing.assert_array_equal(both.history.training_error[:4], half.history.training_error)
    assert both.linear is not None
    np.testing.assert_array_equal(both.linear.a, start.a)


def test_an_interrupt_loses_nothing() -> None:
    system = nonlinear_system(2, 1, 1)
    seen: list[FitProgress] = []

    def progress(state: FitProgress) -> None:
        seen.append(state)
        if state.iteration == 2:
            raise KeyboardInterrupt

    fit = fit_pnlss(disturbed(system), [experiment(system, 400, noise=0.01)], progress=progress)
    assert fit.interrupted
    assert fit.message == "interrupted"
    assert fit.history.iterations == fit.chosen == 2
    assert [state.training_error for state in seen] == fit.history.training_error[1:].tolist()


def test_a_ridge_makes_nonlinear_coefficients_small() -> None:
    system = nonlinear_system(2, 1, 1)
    experiments = [experiment(system, 800, noise=0.1)]
    free, held = (
        fit_pnlss(disturbed(system), experiments, settings=FitSettings(iterations=8, ridge=ridge))
        for ridge in (0.0, 10.0)
    )
    units = {name: np.sqrt(np.mean(getattr(experiments[0], name) ** 2, axis=1)) for name in ("inputs", "outputs")}
    free_size, held_size = (
        np.hypot(np.linalg.norm(model.e), np.linalg.norm(model.f))
        for model in (fit.model.scaled(states=fit.state_scale, **units) for fit in (free, held))
    )
    assert held_size < 0.5 * free_size
    assert held.training_error > free.training_error


def test_errors_outside_the_band_do_not_count() -> None:
    system = linear_system(2, 1, 1)
    one = periodic_experiment(system, 400)
    time_s = np.arange(one.inputs.shape[1]) / one.sample_rate_hz
    hum = 0.5 * np.sin(2.0 * np.pi * 40.0 * time_s)
    fit = fit_pnlss(
        disturbed(system), [replace(one, outputs=one.outputs + hum)], settings=FitSettings(band_hz=(1.0, 30.0))
    )
    assert fit.training_error < 1e-6
    assert pnlss_errors(fit.model, [one]).relative[0, 0] < 1e-5


def test_outputs_count_by_their_rms_or_as_they_are() -> None:
    system = nonlinear_system(2, 1, 2)
    one = experiment(system, 600)
    rng = np.random.default_rng(0)
    wrong = np.array([[100.0], [1.0]]) * (one.outputs + 0.2 * rng.normal(size=one.outputs.shape))
    start = disturbed(system)
    start = replace(start, c=start.c * [[100.0], [1.0]], d=start.d * [[100.0], [1.0]])
    experiments = [replace(one, outputs=wrong)]
    alike, plain = (
        fit_pnlss(start, experiments, settings=FitSettings(outputs=outputs, iterations=10))
        for outputs in ("rms", "none")
    )
    errors = [pnlss_errors(fit.model, experiments).rms[0] for fit in (alike, plain)]
    assert errors[1][0] < errors[0][0]  # the loud output fits better, on cost of the quiet one
    assert errors[1][1] > errors[0][1]


def test_steps_into_the_unbounded_are_rejected_without_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    system = nonlinear_system(2, 1, 1)
    few = [experiment(system, 70, noise=1.0)]
    start = disturbed(system, 0.05)
    tried: list[float] = []
    training_error = Problem.training_error

    def seen(problem: Problem, vector: NDArray[np.float64]) -> float:
        tried.append(training_error(problem, vector))
        return tried[-1]

    monkeypatch.setattr(Problem, "training_error", seen)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = fit_pnlss(start, few, settings=FitSettings(damping=1e-15, iterations=20))
    assert np.inf in tried
    assert np.all(np.isfinite(fit.history.training_error))
    assert np.all(np.diff(fit.history.training_error) < 0.0)


def test_what_a_fit_holds_does_not_grow_with_the_samples() -> None:
    system = nonlinear_system(2, 1, 2)
    parameters = Parameters(system)
    vector = parameters.vector(system, np.zeros((0, 2)))
    peaks = []
    for samples in (2_000, 20_000):
        records = records_of([experiment(system, samples)], np.ones(1), np.ones(2))
        tracemalloc.start()
        normal_equations(parameters, vector, records, np.ones(2))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]
    assert peaks[1] < 20_000 * parameters.count * 8  # one output of the whole Jacobian


def test_memory_that_is_not_there_is_asked_for_before_the_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    system = nonlinear_system(2, 1, 1)
    one = periodic_experiment(system, 400)
    need = needed_bytes(Parameters(system), [one], True)
    assert need["Jacobian of a period"] >= 8 * 400 * Parameters(system).shared
    monkeypatch.setattr(checks, "available_bytes", lambda: sum(need.values()) - 1)
    with refused(IdentificationError, "are-free-leave-the-frequency-weighting", field="memory"):
        fit_pnlss(disturbed(system), [one], settings=FitSettings(band_hz=(0.0, 50.0)))
    assert fit_pnlss(disturbed(system), [one], settings=FitSettings(iterations=1)).history.iterations == 1


@pytest.mark.parametrize(("level", "driven"), [(1.0, [True, True]), (1e-3, [True, False]), (1.0, [False, False])])
def test_states_are_scaled_by_their_rms_in_the_start_and_those_at_rest_as_the_largest_or_by_one(
    level: float, driven: list[bool]
) -> None:
    """Two states without memory, ``x_i(t + 1) = b_i u(t)``: their RMS is that of the input times ``b_i``."""
    system = linear_system(2, 1, 1)
    begin = level * np.array([[0.5], [4.0]]) * np.array(driven)[:, None]
    start = replace(system, a=np.zeros((2, 2)), b=begin, c=np.array([[1.0, 1.0]]), d=np.array([[1.0]]))
    one = experiment(start, 400)
    fit = fit_pnlss(start, [one], settings=FitSettings(iterations=0))
    rms = np.abs(begin[:, 0]) * np.sqrt(np.sum(one.inputs[0, :-1] ** 2) / one.inputs.shape[1])
    np.testing.assert_allclose(fit.state_scale, np.where(driven, rms, np.max(rms) or 1.0), rtol=1e-12)
