"""Frequency responses of nonlinear state-space models as predictions like any other, and how they end."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from identification import (
    FrequencyResponse,
    IdentificationError,
    PnlssModel,
    Predictions,
    compare,
    error_table,
    frequency_response,
    harmonic_response,
    steady_state,
)
from identification.storage import decode, encode
from rig.results.predictions.figure import draw_predictions
from rig.results.predictions.table import TABLE
from tests.identification.models.pnlss.steady.oscillators import HZ, oscillator, shaker
from tests.refused import refused

CUBIC, FORCE_N = 6e8, 1.2


def test_every_motion_gives_the_same_displacement() -> None:
    found = frequency_response(oscillator(CUBIC, rate_hz=12800.0), FORCE_N, force="pure-sine", largest_range_use=3.0)
    assert found.channels == ("acc", "vel", "tip")
    np.testing.assert_allclose(found.motion_m("acc"), found.motion_m("tip"), rtol=3e-3)
    np.testing.assert_allclose(found.motion_m("vel"), found.motion_m("tip"), rtol=3e-3)
    peak = found.peak()
    assert peak.phase_lag_deg == pytest.approx(90.0, abs=2.0)
    assert peak.amplitude_m == pytest.approx(FORCE_N / (2 * 0.01 * (2 * np.pi) ** 2 * HZ * peak.frequency_hz), rel=1e-2)


def test_phases_refer_to_the_force_that_the_exciter_makes() -> None:
    model = oscillator(0.0)
    found = frequency_response(
        model, 1.0, force="fundamental", exciter=shaker(), band_hz=(23.0, 27.0), largest_range_use=3.0
    )
    pure = frequency_response(model, 1.0, force="pure-sine", band_hz=(23.0, 27.0), largest_range_use=3.0)
    np.testing.assert_allclose(found.fundamental_n, 1.0, rtol=1e-9)
    z = np.exp(2j * np.pi * found.frequency_hz / model.sample_rate_hz)
    linear = model.linear_part.response(z)[:, 0, 0]
    np.testing.assert_allclose(found.acceleration_m_s2(), linear, rtol=1e-8)
    assert pure.peak().frequency_hz == pytest.approx(found.peak().frequency_hz, rel=1e-4)


def test_predictions_are_compared_packed_shown_and_drawn_like_any_other(capsys: pytest.CaptureFixture[str]) -> None:
    found = frequency_response(oscillator(CUBIC), FORCE_N, force="pure-sine", largest_range_use=3.0)
    reference = FrequencyResponse(
        frequency_hz=found.frequency_hz,
        force=np.full(found.frequency_hz.size, FORCE_N + 0j),
        response=found.motion_m() / 1.1,
        kind="displacement",
        controlled="force",
        level=FORCE_N,
    )
    for over in ("frequency", "phase"):
        comparison = compare(found, reference, over=over)  # type: ignore[arg-type]
        assert comparison.error.peak_error == pytest.approx(0.1, rel=1e-3)
        assert comparison.error.peak_frequency_error == pytest.approx(0.0, abs=1e-6)
    together = Predictions(steady=(found,), steady_references=(reference,), steady_errors=(comparison.error,))
    again = decode(Predictions, *encode(together))
    np.testing.assert_array_equal(again.steady[0].displacement_m, found.displacement_m)
    np.testing.assert_array_equal(again.steady[0].modal_amplitude, np.full(found.frequency_hz.size, np.nan))
    assert again.steady[0].notes == found.notes
    TABLE.say(TABLE.summarise(again))
    shown = capsys.readouterr().out
    assert "held: a force without harmonics" in shown
    assert f"{found.fold_frequency_hz[0]:.4f}" in shown
    page = Figure(figsize=(12.0, 7.0), layout="constrained")
    draw_predictions(page, again)
    page.draw_without_rendering()


def test_an_unknown_range_is_said_to_be_unknown() -> None:
    unknown = replace(oscillator(CUBIC), state_range=np.full(2, np.nan), input_range=np.full(1, np.nan))
    found = frequency_response(unknown, FORCE_N, force="pure-sine", largest_range_use=3.0)
    assert np.isnan(found.range_use).all()
    assert "the range of the states in the training data is unknown" in found.notes
    reference = FrequencyResponse(
        found.frequency_hz[:9], np.ones(9, complex), found.motion_m()[:9], "displacement", "force", 1.0
    )
    assert "identified range unknown" in error_table([compare(found, reference, phase_window_deg=180.0).error])
    together = Predictions(steady=(found,), steady_references=(None,), steady_errors=(None,))
    page = Figure(figsize=(12.0, 7.0), layout="constrained")
    draw_predictions(page, together)
    page.draw_without_rendering()


def test_range_use_is_that_of_a_simulation() -> None:
    model = oscillator(CUBIC, largest_m=2e-3)
    state = steady_state(model, 25.0, FORCE_N, force="pure-sine", largest_range_use=3.0)
    run = model.simulate(FORCE_N * np.cos(2 * np.pi / 128 * np.arange(128 * 400))[None])
    last = np.abs(run.states[:, -128:]).max(axis=1) / model.state_range
    np.testing.assert_allclose(state.state_use[0], last, rtol=2e-3)
    np.testing.assert_allclose(state.input_use[0], [0.12], rtol=1e-3)


def test_a_path_that_leaves_the_trained_range_ends_there_and_is_met_from_above() -> None:
    model = oscillator(CUBIC, largest_m=5e-4)
    found = harmonic_response(model, FORCE_N, force="pure-sine", largest_range_use=3.0)
    assert set(found.branch.tolist()) == {0, 1}
    assert found.points.frequency_hz[found.branch == 1][0] == pytest.approx(1.15 * HZ, rel=1e-4)
    assert np.max(found.points.range_use) < 3.5
    ends = [note for note in found.notes if "beyond 3 times those of the training data" in note]
    assert len(ends) == 2
    assert any("extrapolated" in note for note in found.notes)
    assert not found.complete
    assert not found.prediction.complete
    farther = harmonic_response(model, FORCE_N, force="pure-sine", largest_range_use=20.0)
    assert set(farther.branch.tolist()) == {0}
    assert np.max(farther.points.range_use) > 3.5
    assert farther.complete
    assert farther.prediction.peak_reached()


def test_a_peak_where_the_curve_was_cut_off_has_no_error() -> None:
    whole = frequency_response(oscillator(CUBIC), FORCE_N, force="pure-sine", largest_range_use=3.0)
    cut = frequency_response(oscillator(CUBIC, largest_m=5e-4), FORCE_N, force="pure-sine", largest_range_use=3.0)
    alone = replace(
        cut,
        **{
            name: getattr(cut, name)[cut.branch == 0]
            for name in (
                "frequency_hz",
                "modal_amplitude",
                "fundamental_n",
                "displacement_m",
                "stable",
                "branch",
                "range_use",
            )
        },
    )
    reference = FrequencyResponse(
        whole.frequency_hz, np.full(whole.frequency_hz.size, 1j), whole.motion_m(), "displacement", "force", FORCE_N
    )
    for found in (cut, alone):
        assert found.peak().amplitude_m < 0.9 * whole.peak().amplitude_m
        assert not found.peak_reached()
        error = compare(found, reference).error
        assert "the prediction is largest where it was cut off: it has no peak to compare" in error.notes
        assert (error.row()["peak_error"], error.row()["peak_frequency_error"]) == (None, None)
        assert error_table([error]).splitlines()[1].split()[4:6] == ["-", "-"]
    arrays, attributes = encode(Predictions(steady=(cut,), steady_references=(None,), steady_errors=(None,)))
    assert not decode(Predictions, arrays, attributes).steady[0].complete
    del attributes["steady"][0]["complete"]  # as files without it have it
    assert decode(Predictions, arrays, attributes).steady[0].complete


def test_a_vibration_beyond_the_range_is_found_nowhere_along_the_way() -> None:
    model = oscillator(CUBIC)
    use = steady_state(model, 25.0, FORCE_N, force="pure-sine", largest_range_use=3.0).range_use[0]  # type: ignore[index]
    with refused(IdentificationError, "no-periodic-vibration-was-found-at", field="frequency_hz"):
        steady_state(model, 25.0, FORCE_N, force="pure-sine", largest_range_use=0.99 * use)


def test_a_model_without_a_periodic_vibration_is_reported_in_one_line() -> None:
    escaping = oscillator(-6e8)
    with refused(IdentificationError, "at-the-model-has-no-periodic", field="force_n"):
        frequency_response(escaping, 400.0, force="pure-sine", band_hz=(24.0, 25.0), largest_range_use=3.0)
    with refused(IdentificationError, "no-periodic-vibration-was-found-at-2", field="frequency_hz"):
        steady_state(escaping, 25.0, 400.0, force="pure-sine", largest_range_use=3.0)
    softening = harmonic_response(escaping, 0.9, force="pure-sine", largest_range_use=3.0)
    assert softening.folds.count == 2
    assert softening.points.frequency_hz[-1] == pytest.approx(1.15 * HZ)


def test_a_band_beside_the_resonance_is_said_to_miss_it() -> None:
    missed = frequency_response(
        oscillator(CUBIC), FORCE_N, force="pure-sine", band_hz=(20.0, 23.0), largest_range_use=3.0
    )
    assert "the largest amplitude is at an end of the band: widen it" in missed.notes
    hit = frequency_response(oscillator(CUBIC), FORCE_N, force="pure-sine", band_hz=(20.0, 28.0), largest_range_use=3.0)
    assert not any("widen" in note for note in hit.notes)


def test_without_a_lightly_damped_mode_a_band_is_asked_for() -> None:
    damped = oscillator(0.0, damping=0.6)
    with refused(IdentificationError, "not-given-and-the-model-linear", field="band_hz"):
        frequency_response(damped, 1.0, force="pure-sine", largest_range_use=3.0)
    found = frequency_response(damped, 1.0, force="pure-sine", band_hz=(5.0, 50.0), largest_range_use=3.0)
    assert (found.frequency_hz[0], found.frequency_hz[-1]) == (5.0, 50.0)


def test_a_model_without_motion_has_no_amplitude_to_predict() -> None:
    model = oscillator()
    names = (
        "a",
        "b",
        "e",
        "state_features",
        "output_features",
        "sample_rate_hz",
        "inputs",
        "state_range",
        "input_range",
    )
    blind = PnlssModel(
        **{name: getattr(model, name) for name in names},
        c=model.c[:1],
        d=model.d[:1],
        f=model.f[:1],
        outputs=(replace(model.outputs[0], role="monitor"),),
    )
    with refused(IdentificationError, "no-output-is-motion", field="model"):
        frequency_response(blind, 1.0, force="pure-sine", band_hz=(20.0, 30.0), largest_range_use=3.0)
