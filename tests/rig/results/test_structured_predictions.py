"""Structured models asked for steady vibrations and sweeps on the command line, against the virtual rig and its recordings."""

import json

import numpy as np
import pytest

from rig.campaigns.plans import plan_from
from simulators import VirtualRig
from simulators.analysis import constant_force_response, phase_resonance_backbone
from tests.recorded import recorded_at
from tests.sharing import copy_of, made_once, shared_folder

LINES = {"bench": "magnet-beam", "kind": "multisine", "lowest_hz": 15.0, "highest_hz": 35.0, "resolution_hz": 0.25}
LINES |= {"transient_periods": 3, "periods": 2, "realisations": 2, "levels_rms_v": [0.6]}
SWEEP = {"bench": "magnet-beam", "kind": "sweep", "start_hz": 22.0, "stop_hz": 27.0, "rate_hz_per_s": 1.0}


@pytest.fixture(scope="session")
def model(shelf):
    """A model of the one-sided magnet beam beside its recordings, and the plan of a sweep."""
    from rig.results.files import save
    from rig.results.identify import identify_model
    from rig.results.structured.options import StructuredOptions

    recorded_at(shelf / "lines.h5", plan_from(LINES, "lines"), seed=1)
    request = StructuredOptions(modes=shelf / "LIN.h5", rate_hz=400.0, outputs="drive")

    def fit(folder):
        save(identify_model([shelf / "lines.h5"], request), folder / "ST.h5")

    copy_of(made_once(shared_folder() / "structured-predictions", fit), shelf)
    plan = SWEEP | {"levels_v": [0.3]}
    (shelf / "ahead.toml").write_text("\n".join(f"{name} = {json.dumps(value)}" for name, value in plan.items()))
    recorded_at(shelf / "ahead.h5", plan_from(plan, "ahead"), seed=2)
    return shelf / "ST.h5"


@pytest.fixture
def told(command, model, monkeypatch):
    """What a prediction says, typed in the folder of the model."""

    def typed(line):
        monkeypatch.chdir(model.parent)
        done = command(f"predict ST.h5 {line} -o OUT.h5 --overwrite --json")
        assert done.status == 0, done.err
        return json.loads(done.out)

    return typed


@pytest.mark.slow
def test_peaks_at_a_constant_force_are_those_of_the_rig(told):
    truth = VirtualRig.shipped("magnet-beam")
    (sine,) = told("--frequency-response 0.13")["frequency_responses"]
    exact = phase_resonance_backbone(truth, forces_n=0.13 * np.linspace(0.1, 1.0, 8), excitation="pure-sine")
    assert sine["peak_m"] == pytest.approx(exact.amplitude_m[-1], rel=0.02)
    assert sine["peak_frequency_hz"] == pytest.approx(exact.frequency_hz[-1], rel=2e-3)
    (held,) = told("--frequency-response 0.13 --exciter EX.h5")["frequency_responses"]
    exact = constant_force_response(truth, 0.13, np.linspace(-150.0, -30.0, 41))
    assert held["force"] == "fundamental"
    assert held["peak_m"] == pytest.approx(np.max(exact.amplitude_m), rel=0.02)
    assert held["peak_frequency_hz"] == pytest.approx(exact.frequency_hz[np.argmax(exact.amplitude_m)], rel=2e-3)


@pytest.mark.slow
def test_bands_hold_the_peaks_of_other_models_that_the_fit_allows(told, model):
    """Against first-order errors along the numbers of the fit, of amplitude and frequency at phase resonance."""
    from identification import backbone
    from identification.models import std_of
    from rig.results.files import load

    (sine,) = told("--frequency-response 0.05 --bands")["frequency_responses"]

    def peak_of(one):
        curve = backbone(one, 0.05, largest_range_use=3.0)
        return np.array([abs(curve.displacement_m[-1, 1, 0]), curve.frequency_hz[-1]])

    fit = load(model).fit
    expected = std_of(fit, peak_of)
    assert sine["peak_m"] == pytest.approx(peak_of(fit.model)[0], rel=1e-3)
    # and the error that the fit left: of the amplitude twice that, of the frequency eight times that of half a bandwidth
    left = np.array([2.0, 8.0 * fit.model.linearised().damping_ratio[0]]) * fit.training_error * peak_of(fit.model)
    found = [sine["peak_std_m"], sine["peak_frequency_std_hz"]]
    assert found == pytest.approx(expected + left / 1.96, rel=0.4)
    assert told("--frequency-response 0.05")["frequency_responses"][0]["peak_std_m"] is None


def test_a_model_without_its_fit_has_no_bands(model, command, monkeypatch):
    from dataclasses import replace

    from rig.results.files import load, save

    monkeypatch.chdir(model.parent)
    save(replace(load(model), fit=None), model.parent / "alone.h5")
    done = command("predict alone.h5 --frequency-response 0.05 --bands -o OUT.h5 --overwrite")
    assert done.status == 1
    assert done.err == "rig: --bands: alone.h5 has a model without its fit, whose covariance they need; leave it out\n"


def test_recorded_sweeps_are_followed_from_the_force_and_from_the_voltage(told):
    for line, origin in (("", "the recorded force"), ("--exciter EX.h5", "the recorded voltage")):
        found = told(f"--sweep ahead.h5 {line}")
        assert found["sweeps"][0]["origin"] == origin
        assert not found["sweeps"][0]["unbounded"]
        (error,) = found["errors"]
        assert abs(error["peak_error"]) < 0.005
        assert error["envelope_error"] < 0.005


@pytest.mark.slow
def test_a_planned_sweep_is_that_which_is_recorded_later(told):
    both = told("--planned-sweep ahead.toml --sweep ahead.h5 --exciter EX.h5")["sweeps"]
    assert both[0]["peak_m"] == pytest.approx(both[1]["peak_m"], rel=0.02)


def test_responses_to_a_voltage_and_references_are_answered(told):
    found = told("--voltage-response 0.1 --reference stepped.h5 --exciter EX.h5")["frequency_responses"]
    assert found[0]["force"] == "voltage"
    assert abs(found[1]["error"]["peak_error"]) < 0.005


@pytest.mark.slow
def test_figures_are_drawn_and_other_responses_refused(told, command, model, monkeypatch):
    told("--frequency-response 0.05 --sweep ahead.h5 --multisine lines.h5")
    monkeypatch.chdir(model.parent)
    assert command("plot OUT.h5 -o OUT.png").status == 0
    said = command("predict ST.h5 --frequency-response 0.9 --allow-extrapolation -o BIG.h5 --overwrite").out
    assert "elements reach" in said


@pytest.mark.slow
def test_beyond_twice_the_training_a_response_and_a_planned_sweep_are_refused(command, model, monkeypatch):
    monkeypatch.chdir(model.parent)
    loud = (model.parent / "ahead.toml").read_text().replace("[0.3]", "[6.0]")
    (model.parent / "loud.toml").write_text(loud)
    for line in ("--frequency-response 5", "--planned-sweep loud.toml --exciter EX.h5"):
        done = command(f"predict ST.h5 {line} -o BIG.h5 --overwrite")
        assert done.status == 1
        assert "above 2 nothing is known of the error" in done.err or "leaves the range" in done.err


@pytest.mark.slow
def test_the_band_of_a_planned_sweep_holds_that_which_is_recorded_later(told):
    found = told("--planned-sweep ahead.toml --sweep ahead.h5 --exciter EX.h5 --bands")["sweeps"]
    (low_m, high_m), (low_hz, high_hz) = found[0]["peak_band_m"], found[0]["peak_band_hz"]
    assert low_m < found[1]["peak_m"] < high_m
    assert low_hz < found[1]["peak_frequency_hz"] < high_hz
    assert high_m < 1.2 * low_m


@pytest.mark.slow
def test_its_backbone_lies_on_that_which_is_measured(model, command, monkeypatch):
    from identification import structured_mode
    from rig.results.files import load

    monkeypatch.chdir(model.parent)
    done = command("plot ST.h5 backbone.h5 NM.h5 -o over.png")
    assert done.status == 0, done.err
    measured, found = load(model.parent / "NM.h5"), structured_mode(load(model).fit)
    # At small amplitudes no more is known than what the modal test is trusted to; at those of the training data, more.
    assert found.modal_frequency_std_hz.max() < 1e-3 * found.modal_frequency_hz.max()
    assert found.modal_frequency_std_hz.min() < 1e-4 * found.modal_frequency_hz.max()
    inside = measured.amplitude_m < found.amplitude_m.max()
    assert inside.sum() > 3
    at = measured.amplitude_m[inside]
    for name, share in (("modal_frequency_hz", 5e-4), ("damping_ratio", 0.02)):
        own = np.interp(at, found.amplitude_m, getattr(found, name))
        np.testing.assert_allclose(own, getattr(measured, name)[inside], rtol=share)
