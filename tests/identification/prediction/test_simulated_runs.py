"""Errors of simulated experiments against what can be worked out without a simulation."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import dlsim, dlti

from identification import (
    Channel,
    Experiment,
    Features,
    IdentificationError,
    PnlssModel,
    error_spectra,
    estimated_initial_state,
    output_stretch,
    simulated_run,
)
from identification.linear.subspace import StateSpace
from tests.refused import refused

A = np.array([[0.95, 0.25], [-0.25, 0.95]]) * 0.99
LINEAR = StateSpace(A, np.array([[0.0], [1.0]]), np.array([[1.0, 0.3], [0.2, 2.0]]), np.array([[0.1], [0.0]]))
CHANNELS = {
    "input_channels": (Channel("force", "force", "N"),),
    "output_channels": (Channel("drive", "drive", "m"), Channel("tip", "response", "m")),
}


def model() -> PnlssModel:
    found = PnlssModel.linear(
        LINEAR, sample_rate_hz=100.0, inputs=CHANNELS["input_channels"], outputs=CHANNELS["output_channels"]
    )
    return replace(found, state_range=np.array([2.0, 4.0]), input_range=np.array([1.0]))


def experiment(x0=None, wrong=(0.0, 0.0), **changes) -> Experiment:
    """What scipy makes of white noise, each output off by a share of itself."""
    u = np.random.default_rng(0).normal(size=400)
    _, y, _ = dlsim(dlti(*LINEAR, dt=1.0), u, x0=x0)
    return Experiment(
        inputs=u[None], outputs=y.T * (1.0 + np.array(wrong)[:, None]), sample_rate_hz=100.0, **CHANNELS, **changes
    )


def test_outputs_off_by_a_share_have_that_relative_error():
    run = simulated_run(model(), experiment(wrong=(0.25, 0.0), name="noise", counted_from=100))
    assert run.bounded
    assert run.name == "noise"
    assert run.row()["errors"] == {"drive": pytest.approx(0.25 / 1.25), "tip": pytest.approx(0.0, abs=1e-12)}


def test_range_use_is_the_largest_over_the_range():
    found = model()
    u = experiment().inputs
    _, _, states = dlsim(dlti(*LINEAR, dt=1.0), u[0])
    wanted = max(np.abs(u).max() / 1.0, *(np.abs(states).max(axis=0) / found.state_range))
    assert simulated_run(found, experiment()).range_use == pytest.approx(wanted)


def test_a_run_that_leaves_all_bounds_has_no_error_but_an_instant():
    cubic = model().with_features(Features.monomials(2, 1, [3], of=range(2)))
    run = simulated_run(replace(cubic, e=np.full(cubic.e.shape, 5.0)), experiment(counted_from=2))
    assert not run.bounded
    assert 0.0 <= run.unbounded_at_s < 1.0
    assert np.isinf(run.error).all()
    assert np.isinf(run.range_use)
    row = json.loads(json.dumps(run.row(), allow_nan=False))
    assert (row["errors"]["tip"], row["range_use"], row["level"]) == (None, None, None)
    late = simulated_run(replace(cubic, e=np.full(cubic.e.shape, 5.0)), experiment(counted_from=300))
    assert late.unbounded_at_s == run.unbounded_at_s  # since the record began, be it before what counts


def test_an_initial_state_is_estimated_where_the_experiment_asks_for_it():
    x0 = np.array([1.5, -3.0])
    asked = experiment(x0=x0, initial_state="estimated")
    np.testing.assert_allclose(estimated_initial_state(model(), asked), x0, rtol=1e-6)
    unknown = replace(model(), state_range=np.full(2, np.nan), input_range=np.full(1, np.nan))
    np.testing.assert_allclose(estimated_initial_state(unknown, asked), x0, rtol=1e-6)
    assert simulated_run(model(), asked).error.max() < 1e-6
    assert simulated_run(model(), experiment(x0=x0)).error.max() > 0.1


def test_an_output_that_is_zero_has_no_relative_error():
    dead = experiment()
    dead = replace(dead, name="dead", outputs=dead.outputs * [[1.0], [0.0]])
    with refused(IdentificationError, "output-tip-is-zero-where-it"):
        simulated_run(model(), dead)


def test_spectra_of_a_sine_are_its_amplitude_and_that_of_the_error():
    turn = 2.0 * np.pi * 5 / 200 * np.arange(200)
    response = LINEAR.response(np.exp(1j * np.array([2.0 * np.pi * 5 / 200])))[0, :, 0]
    measured = 1.1 * np.real(response[:, None] * np.exp(1j * turn))
    sine = Experiment.periodic(np.cos(turn)[None], measured, transient_samples=2000, sample_rate_hz=100.0, **CHANNELS)
    found = error_spectra(model(), None, sine)
    at = int(np.argmin(np.abs(found.frequency_hz - 2.5)))
    np.testing.assert_allclose(found.measured[:, at], 1.1 * np.abs(response), rtol=1e-9)
    np.testing.assert_allclose(found.error[:, at], 0.1 * np.abs(response), rtol=1e-6)
    np.testing.assert_allclose(found.model[:, at], np.abs(response), rtol=1e-6)
    assert np.isnan(found.noise).all()
    rows = len(sine.inputs) + 2
    known = replace(sine, noise_covariance=np.full((99, rows, rows), 1e-4 + 0j))
    np.testing.assert_allclose(error_spectra(model(), None, known).noise, 0.01, rtol=1e-12)
    assert np.isnan(found.linear_error).all()
    with refused(IdentificationError, "not-periodic"):
        error_spectra(model(), None, experiment())


def test_a_stretch_lies_around_the_largest_output_and_has_what_scipy_simulates():
    measured = experiment(wrong=(0.25, 0.0), counted_from=50)
    found = output_stretch(model(), measured, samples=60)
    top = 50 + int(np.argmax(np.abs(measured.outputs[0, 50:])))
    assert found.time_s.size == 60
    assert found.time_s[0] <= top / 100.0 <= found.time_s[-1]
    first = round(found.time_s[0] * 100.0)
    np.testing.assert_array_equal(found.measured, measured.outputs[:, first : first + 60])
    np.testing.assert_allclose(found.simulated, experiment().outputs[:, first : first + 60], atol=1e-9)


def test_a_stretch_of_a_run_that_leaves_all_bounds_ends_there():
    cubic = model().with_features(Features.monomials(2, 1, [3], of=range(2)))
    found = output_stretch(replace(cubic, e=np.full(cubic.e.shape, 5.0)), experiment(), samples=400)
    assert np.isnan(found.simulated[:, -1]).all()
    assert np.isfinite(found.measured).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sample_rate_hz": 200.0}, {"says": "sampled-at-hz-the-model-is-2"}),
        ({"input_channels": (Channel("voltage", "monitor", "V"),)}, {"says": "inputs-are-voltage-the-model-has-force"}),
    ],
)
def test_experiments_of_other_rates_or_channels_are_refused(changes, said):
    with refused(IdentificationError, **said):
        simulated_run(model(), replace(experiment(), **changes))
