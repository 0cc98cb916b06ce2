"""Multisines that have not been measured, and inputs that are constant, as ``rig predict`` simulates them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from identification import Channel, Experiment, Features, PnlssModel, Predictions, StateSpace
from rig.campaigns.plans import plan_from
from rig.errors import ConfigurationError
from rig.results.files import load, save
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.predictions.runs_figure import draw_runs
from rig.results.simulated.driven_models import all_inputs, constants_of, with_constants
from rig.results.simulated.multisines import planned_multisines
from tests.refused import refused

PLAN = {"kind": "multisine", "bench": "magnet-beam", "lowest_hz": 15.0, "highest_hz": 35.0, "resolution_hz": 0.25}
PLAN |= {"realisations": 2, "levels_rms_v": [0.1, 0.2], "transient_periods": 2, "periods": 1}
RATE_HZ = 400.0


def voltage_model(constant: bool = False) -> PnlssModel:
    """An oscillator at 25 Hz from the voltage to force and drive; with a constant input that moves both by known amounts."""
    pole = np.exp(2 * np.pi * 25.0 / RATE_HZ * (-0.02 + 1j * np.sqrt(1 - 0.02**2)))
    a = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    inputs = [Channel("voltage", "monitor", "V")] + [Channel("constant", "monitor", "1")] * constant
    b = np.array([[0.2, 0.0], [0.1, 0.0]])[:, : len(inputs)]
    d = np.array([[1.0, 0.3], [0.0, 0.5]])[:, : len(inputs)]
    outputs = (Channel("force", "force", "N"), Channel("drive", "drive", "m"))
    linear = PnlssModel.linear(
        StateSpace(a, b, np.array([[0.0, 0.1], [1.0, 0.0]]), d),
        sample_rate_hz=RATE_HZ,
        inputs=tuple(inputs),
        outputs=outputs,
        specimen="magnet beam (one-sided)",
    )
    return replace(linear, state_range=np.ones(2), input_range=np.array([1.0, 2.0])[: len(inputs)])


def plan_file(folder, **changes):
    path = folder / "plan.toml"
    path.write_text("\n".join(f"{name} = {json.dumps(value)}" for name, value in {**PLAN, **changes}.items()))
    return path


def test_a_linear_model_reaches_what_its_frequency_response_says(tmp_path):
    model = voltage_model()
    runs, notes = planned_multisines(str(plan_file(tmp_path)), model, None, {})
    assert [(run.level, run.use) for run in runs] == [(0.1, "planned")] * 2 + [(0.2, "planned")] * 2
    plan = plan_from(PLAN, "plan")
    samples = round(RATE_HZ / plan.resolution_hz)
    z = np.exp(2j * np.pi * np.arange(samples // 2 + 1) / samples)
    response = model.linear_part.response(z)[:, :, 0]
    design = plan.design(5000.0)  # any rate: the lines and their phases are those of the plan
    for run in runs:
        lines = design.lines
        rms = np.sqrt(np.mean(np.abs(response[lines]) ** 2, axis=0)) * run.level
        np.testing.assert_allclose(run.rms, rms, rtol=1e-3)  # the transient has decayed to exp(-2 pi 0.02 25 8)
        assert np.all(run.peak > run.rms)
        assert np.all(np.isnan(run.error))
    np.testing.assert_allclose(runs[2].peak, 2.0 * runs[0].peak, rtol=1e-9)
    assert not notes


def test_the_command_tells_what_planned_multisines_reach_and_draws_it(command, tmp_path):
    plan_file(tmp_path)
    save(voltage_model(), tmp_path / "model.h5")
    told = command("predict model.h5 --planned-multisine plan.toml -o predicted.h5").out
    assert "planned multisines: RMS and largest value of the outputs" in told
    assert "planned 0.2 V RMS, realisation 2" in told
    predicted = load(tmp_path / "predicted.h5")
    assert isinstance(predicted, Predictions)
    assert [run.use for run in predicted.runs] == ["planned"] * 4
    page = Figure()
    draw_runs(page, predicted)
    assert "4 planned multisines" in page.axes[0].get_title()
    assert "V RMS" in page.axes[0].get_xlabel()


def test_an_unbounded_planned_multisine_is_said_to_be(command, tmp_path):
    plan_file(tmp_path)
    model = voltage_model().with_features(Features.monomials(2, 1, (3,), of=(0, 1)))
    e = np.array(model.e)
    e[0, 0] = 5.0
    save(replace(model, e=e), tmp_path / "model.h5")
    assert "unbounded" in command("predict model.h5 --planned-multisine plan.toml -o predicted.h5").out


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"highest_hz": 180.0}, {"says": "goes-up-to-hz-model-at"}),
        ({"resolution_hz": 0.3}, {"says": "resolution-hz-a-period-has-samples"}),
    ],
)
def test_plans_that_do_not_fit_the_model_are_refused(tmp_path, changes, said):
    with refused(ConfigurationError, **said):
        planned_multisines(str(plan_file(tmp_path, **changes)), voltage_model(), None, {})


def test_a_constant_input_is_taken_from_the_training_or_the_request(tmp_path):
    model, path = voltage_model(constant=True), tmp_path / "m.h5"
    assert constants_of(model, (), path) == {"constant": 2.0}
    assert constants_of(model, ("constant=-0.5",), path) == {"constant": -0.5}
    for given, said in (
        ("constant", {"says": "allowed-is-name-value"}),
        ("constant=x", {"says": "allowed-is-name-value"}),
        ("offset=1", {"says": "has-no-input-offset-its-inputs"}),
        ("voltage=1", {"says": "hold-all-inputs-of"}),
    ):
        with refused(ConfigurationError, **said):
            constants_of(model, (given,), path)


def test_a_constant_moves_the_outputs_by_its_static_response(tmp_path):
    model = voltage_model(constant=True)
    path = str(plan_file(tmp_path))
    (plain, *_), _ = planned_multisines(path, model, None, {"constant": 0.0})
    (moved, *_), _ = planned_multisines(path, model, None, {"constant": 2.0})
    # The constant acts on the outputs alone: 0.6 N and 1 m, so that squares add.
    np.testing.assert_allclose(moved.rms**2, plain.rms**2 + np.array([0.6, 1.0]) ** 2, rtol=1e-3)


def test_recorded_inputs_are_completed_in_the_order_of_the_model():
    model = voltage_model(constant=True)
    driven = np.arange(5.0)[None]
    np.testing.assert_array_equal(all_inputs(model, driven, {"constant": 2.0}), [np.arange(5.0), np.full(5, 2.0)])
    recorded = Experiment(
        inputs=driven,
        outputs=np.zeros((2, 5)),
        sample_rate_hz=RATE_HZ,
        input_channels=model.inputs[:1],
        output_channels=model.outputs,
    )
    assert with_constants(recorded, model, {}) is recorded
    whole = with_constants(recorded, model, {"constant": 2.0})
    assert whole.input_channels == model.inputs


def test_a_model_with_a_constant_input_answers_steady_responses_from_the_command(command, tmp_path):
    save(IdentifiedPnlss(model=voltage_model(constant=True)), tmp_path / "model.h5")
    told = command("predict model.h5 --voltage-response 0.1 -o predicted.h5").succeeded()
    assert "0.1 V" in told.out
    assert "constant=1" in command("predict model.h5 --voltage-response 0.1 --constant offset -o x.h5").err
