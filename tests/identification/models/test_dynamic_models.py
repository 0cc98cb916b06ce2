"""What every kind of dynamic model keeps, over all kinds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import identification
from identification import (
    DynamicModel,
    IdentificationError,
    backbone,
    dynamic_model,
    frequency_response,
    harmonic_response,
    response_band,
    steady_state,
)
from identification.models.dynamic_model import SteadyRequest
from tests.identification.models.modal.modes import duffing as modal_duffing
from tests.identification.models.pnlss.steady.oscillators import RATE_HZ, oscillator, shaker
from tests.identification.models.structured.steady.beams import smooth
from tests.identification.models.structured.steady.test_mode import duffing as structured_duffing, fit_of
from tests.refused import refused

CASES = {
    "modal": (modal_duffing(np.linspace(0.2e-3, 12e-3, 60)), 0.5),
    "pnlss": (oscillator(6e7, damping=0.01), 0.5),
    "structured": (smooth(), 0.5),
}
"""A model of each kind, and a force (N) at which it is nonlinear."""
SIMULATED = ("pnlss", "structured")


@pytest.fixture(params=CASES)
def case(request):
    return CASES[request.param]


def test_small_vibrations_are_those_of_the_linearised_model(case):
    model, force_n = case
    small = 0.02 * force_n
    found = frequency_response(model, small, force="pure-sine")
    linear = small * dynamic_model(model).linear_response(found.frequency_hz)
    assert dynamic_model(model).channels == found.channels
    np.testing.assert_allclose(found.displacement_m, linear, atol=2e-3 * np.abs(linear).max())


def test_a_steady_state_lies_on_the_frequency_response(case):
    model, force_n = case
    curve = frequency_response(model, force_n, force="pure-sine")
    peak = curve.peak()
    at = int(np.argmin(np.abs(curve.amplitude_m()[: np.argmax(curve.amplitude_m())] - 0.4 * peak.amplitude_m)))
    assert curve.stable[at]
    alone = steady_state(model, float(curve.frequency_hz[at]), force_n, force="pure-sine")
    np.testing.assert_allclose(alone.displacement_m[0, 1], curve.displacement_m[at], rtol=1e-4)
    assert alone.stable[0]
    assert alone.force_n[0, 1] == pytest.approx(force_n)
    near = steady_state(model, float(curve.frequency_hz[at]), force_n, force="pure-sine", near=alone)
    np.testing.assert_allclose(near.displacement_m[0, 1], alone.displacement_m[0, 1], rtol=1e-6)


@pytest.mark.parametrize("kind", SIMULATED)
def test_a_steady_state_is_where_a_long_simulation_settles(kind):
    model, force_n = CASES[kind]
    samples = round(model.sample_rate_hz / 24.0)
    at_hz = model.sample_rate_hz / samples
    found = steady_state(model, at_hz, force_n, harmonics=9)
    inputs = force_n * np.cos(2.0 * np.pi * np.arange(400 * samples) / samples)
    run = dynamic_model(model).simulate(inputs[None])
    settled = np.fft.rfft(run.outputs[:, -samples:], axis=1)[:, 1] * 2.0 / samples
    np.testing.assert_allclose(found.outputs[0, 1], settled, rtol=0.01)


def test_a_nonlinear_mode_is_not_simulated_over_time():
    model = dynamic_model(CASES["modal"][0])
    for ask in (lambda: model.simulate(np.zeros((1, 10))), lambda: model.coupled_run(shaker(), np.zeros(10), None)):
        with refused(IdentificationError, "nonlinear-mode-cannot-be-simulated-over"):
            ask()
    with refused(IdentificationError, "nonlinear-mode-cannot-predict-harmonics"):
        harmonic_response(CASES["modal"][0], 0.5)


def test_no_answer_leaves_the_range_that_is_allowed(case):
    model, force_n = case
    largest = 0.6 * float(np.max(frequency_response(model, force_n, force="pure-sine").range_use))
    if isinstance(model, identification.NonlinearMode):
        with refused(
            identification.ExtrapolationError, "times-the-largest-modal-amplitude-identified", field="force_n"
        ):
            frequency_response(model, force_n, force="pure-sine", largest_range_use=largest)
    else:
        found = frequency_response(model, force_n, force="pure-sine", largest_range_use=largest)
        assert not found.complete
        assert np.max(found.range_use) < 1.1 * largest
    with refused(IdentificationError, "the-backbone-ends"):
        backbone(model, force_n, force="pure-sine", largest_range_use=largest)


def test_the_validity_range_is_named_and_positive(case):
    limits = dynamic_model(case[0]).validity()
    assert limits
    assert all(limit.quantity and limit.largest > 0.0 for limit in limits)


def test_a_backbone_goes_through_the_peak_of_the_frequency_response(case):
    model, force_n = case
    found = backbone(model, force_n, force="pure-sine")
    peak = frequency_response(model, force_n, force="pure-sine").peak()
    motion = found.displacement_m[:, 1, 0]
    np.testing.assert_allclose(np.abs(found.force_n[[0, -1], 1]), [0.02 * force_n, force_n], rtol=2e-3)
    np.testing.assert_allclose(np.degrees(np.angle(motion)), -90.0, atol=0.2)
    assert np.abs(motion[-1]) == pytest.approx(peak.amplitude_m, rel=2e-3)
    assert found.frequency_hz[-1] == pytest.approx(peak.frequency_hz, rel=2e-3)
    assert found.frequency_hz[-1] > found.frequency_hz[0]


def test_draws_scatter_as_the_covariance_says():
    mode = replace(CASES["modal"][0], modal_frequency_std_hz=np.full(60, 0.02))
    drawn = [one.mode.modal_frequency_hz for one in dynamic_model(mode).draws(200, seed=1)]
    np.testing.assert_allclose(np.std(drawn, axis=0), 0.02, rtol=0.25)
    fit = fit_of(structured_duffing(), {"frequency 1": 1e-3})
    drawn = [np.log(one.model.frequency_hz[0]) for one in dynamic_model(fit).draws(200, seed=1)]
    assert np.std(drawn) == pytest.approx(1e-3, rel=0.2)
    assert np.mean(drawn) == pytest.approx(np.log(fit.model.frequency_hz[0]), abs=3e-4)


@pytest.mark.slow
def test_a_band_is_that_of_responses_of_draws():
    fit = fit_of(structured_duffing(), {"frequency 1": 1e-3})
    band = response_band(fit, 0.02, draws=20)
    assert band.draws == 20
    assert band.peak_frequency_std_hz == pytest.approx(25e-3, rel=0.4)
    # twice the error that the fit left, and the amplitude of a mode whose damping is known falls with the frequency squared
    spread = 1.96 * band.peak_amplitude_std_m / frequency_response(fit, 0.02).peak().amplitude_m
    assert spread == pytest.approx(2.0 * fit.training_error + 1.96 * 2.0e-3, rel=0.2)


def test_a_response_whose_stability_is_not_asked_for_is_the_same_with_its_folds():
    model, force_n = CASES["structured"]
    request = SteadyRequest(level=force_n, held="pure-sine")
    asked, other = (
        dynamic_model(model).harmonic_response(replace(request, stability=stability), (None, None))
        for stability in (True, False)
    )
    np.testing.assert_array_equal(other.points.displacement_m, asked.points.displacement_m)
    assert np.all(np.isnan(other.points.multipliers))
    assert np.all(np.isfinite(asked.points.multipliers))
    assert other.folds.frequency_hz.size == 2
    assert set(other.points.loss) == {"", "fold"}
    np.testing.assert_array_equal(other.points.stable, asked.points.stable)


def test_what_has_no_covariance_is_not_drawn():
    for kind, reason in (("pnlss", {"says": "no-covariance"}), ("structured", {"says": "give-the-structuredfit"})):
        with refused(IdentificationError, **reason):
            list(dynamic_model(CASES[kind][0]).draws(20, seed=0))


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("modal", {"exciter": shaker()}),
        ("modal", {"band_hz": (20.0, 30.0)}),
        ("modal", {"support": True}),
        ("pnlss", {"support": True}),
        ("pnlss", {"lowest_share": 0.1}),
        ("structured", {"held_inputs": {"constant": 1.0}}),
        ("structured", {"residuals": False}),
    ],
)
def test_an_option_of_another_kind_is_refused_by_name(kind, options: dict[str, Any]):
    with pytest.raises(IdentificationError) as refused:
        frequency_response(CASES[kind][0], 0.5, **options)
    assert refused.value.field == next(iter(options))


def test_a_level_is_a_force_or_a_voltage(case):
    model, force_n = case
    for options in ({}, {"force_n": force_n, "voltage_v": 1.0}, {"voltage_v": 1.0, "force": "rms"}):
        with pytest.raises(IdentificationError):
            frequency_response(model, **options)
    with refused(IdentificationError, field="force", value="voltage", allowed="pure-sine, fundamental, rms"):
        frequency_response(model, force_n, force="voltage")


def test_another_thing_is_no_model_and_an_own_kind_is_one():
    with refused(
        IdentificationError, field="model", allowed="NonlinearMode, PnlssModel, StructuredModel, StructuredFit"
    ):
        frequency_response(3.0, 1.0)
    own = dynamic_model(CASES["modal"][0])
    assert isinstance(own, DynamicModel)
    np.testing.assert_array_equal(
        frequency_response(own, 0.5).displacement_m, frequency_response(CASES["modal"][0], 0.5).displacement_m
    )


@pytest.mark.parametrize(
    ("old", "new", "options"),
    [
        ("pnlss_frequency_response", "frequency_response", {"force": "pure-sine"}),
        ("pnlss_response", "harmonic_response", {"force": "pure-sine"}),
        ("structured_frequency_response", "frequency_response", {"lowest_hz": 24.0, "highest_hz": 27.0}),
        ("structured_response", "harmonic_response", {}),
        ("structured_backbone", "backbone", {}),
    ],
)
def test_former_names_warn_and_answer_the_same(old, new, options):
    model, force_n = CASES[old.split("_")[0]]
    with pytest.warns(DeprecationWarning, match=f"identification.{old} is now identification.{new}"):
        found = getattr(identification, old)(model, force_n, **options)
    if "lowest_hz" in options:
        options = {"band_hz": (options["lowest_hz"], options["highest_hz"])}
    again = getattr(identification, new)(model, force_n, largest_range_use=3.0, **options)
    frequency_hz, expected = (
        one.points.frequency_hz if hasattr(one, "points") else one.frequency_hz for one in (found, again)
    )
    np.testing.assert_array_equal(frequency_hz, expected)


def test_former_steady_states_runs_and_keywords_warn_and_answer_the_same():
    for kind in SIMULATED:
        model, force_n = CASES[kind]
        with pytest.warns(DeprecationWarning, match="now identification.steady_state"):
            found = getattr(identification, f"{kind}_steady_state")(model, force_n, 24.0, force="pure-sine")
        np.testing.assert_array_equal(found.outputs, steady_state(model, 24.0, force_n).outputs)
    model = oscillator()
    volts = 0.1 * np.sin(2.0 * np.pi * 24.0 * np.arange(2000) / RATE_HZ)
    with pytest.warns(DeprecationWarning, match="now identification.coupled_run"):
        run = identification.pnlss_coupled_run(model, shaker(), volts)
    np.testing.assert_array_equal(run.force_n, identification.coupled_run(model, shaker(), volts).force_n)
    with pytest.warns(
        DeprecationWarning, match="`allow_extrapolation` of frequency_response is now `largest_range_use`"
    ):
        wide = identification.frequency_response(CASES["modal"][0], 0.5, allow_extrapolation=True)
    expected = frequency_response(CASES["modal"][0], 0.5, largest_range_use=np.inf)
    np.testing.assert_array_equal(wide.displacement_m, expected.displacement_m)
