"""Experiments hold what the recording's own measurements say, at another rate."""

import numpy as np
import pytest
from scipy.signal import lfilter

import rig
from identification import IdentificationError
from rig.campaigns.evaluation.stored_point import as_complex
from rig.campaigns.plans import plan_from
from rig.errors import RecordingError
from rig.measurements import point_rows, spectra
from rig.measurements.experiments import default_rate_hz, experiments
from rig.measurements.experiments.signals import Signals
from tests.recorded import recorded_run
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.lossy import lose
from tests.rig.rigs import bench_with

LINES = {
    "bench": "magnet-beam",
    "kind": "multisine",
    "lowest_hz": 15.0,
    "highest_hz": 35.0,
    "resolution_hz": 0.5,
    "realisations": 2,
    "transient_periods": 2,
    "periods": 3,
    "levels_rms_v": [0.2],
    "accepted_change": 1.0,
}
SWEEP = {
    "bench": "magnet-beam",
    "kind": "sweep",
    "start_hz": 18.0,
    "stop_hz": 34.0,
    "rate_hz_per_s": 4.0,
    "levels_v": [0.4, 0.8],
}


@pytest.fixture(scope="module")
def multisine():
    with recorded_run(plan_from(LINES, "lines"), seed=1) as run:
        yield run


@pytest.fixture(scope="module")
def backbone():
    with recorded_run(plan_with(levels_v=(0.6, 1.0), record_periods=40), seed=1) as run:
        yield run


def test_the_noise_of_a_mean_is_the_scatter_of_its_periods(multisine):
    (mean, _), (whole, _) = multisine.experiments(), multisine.experiments(periods="all")
    periods = whole.counted_outputs.reshape(len(whole.outputs), 3, 1600)
    lines = np.fft.rfft(periods)[..., 1:800] * 2.0 / 1600
    scatter = np.std(lines, axis=1, ddof=1) / np.sqrt(3.0)
    assert mean.output_noise.shape == scatter.shape
    np.testing.assert_allclose(mean.output_noise[:, 5:700], scatter[:, 5:700], rtol=1e-6)
    assert whole.output_noise is None


def test_a_period_of_a_multisine_has_the_lines_that_its_spectra_have(multisine):
    measured = spectra(multisine.recording)[0.2]
    made = multisine.experiments()
    assert [one.name[-13:] for one in made] == ["realisation 1", "realisation 2"]
    for one, lines in zip(made, measured.mean, strict=True):
        assert one.sample_rate_hz == 800.0
        assert (one.counted, one.counted_from, one.period_samples) == (1600, 3200, 1600)  # two periods of transient
        found = np.fft.rfft(np.vstack([one.counted_inputs, one.counted_outputs]))[:, 30:71] / 800.0
        np.testing.assert_allclose(found, lines[:-1], atol=1e-9 * np.abs(lines).max())
        assert np.array_equal(one.inputs[:, :1600], one.counted_inputs)  # those before are the same period
        assert np.array_equal(one.inputs[:, 1600:3200], one.counted_inputs)
        assert np.abs(one.counted_outputs.mean(axis=1)).max() < 1e-12


def test_all_periods_follow_one_another_and_their_mean_is_the_mean(multisine):
    mean, every = (multisine.experiments(periods=which, outputs=["drive"])[1] for which in ("mean", "all"))
    assert every.counted == 3 * mean.counted
    averaged = every.counted_outputs.reshape(3, -1).mean(axis=0)
    np.testing.assert_allclose(averaged, mean.counted_outputs[0], atol=1e-9)


def test_with_the_voltage_as_input_the_force_is_an_output(multisine):
    made = multisine.experiments(inputs=["voltage"], rate_hz=5000.0)[0]
    assert [c.name for c in made.input_channels] == ["voltage"]
    assert [c.name for c in made.output_channels] == ["force", "drive", "acc_drive", "acc_magnet"]
    assert made.counted_inputs.std() == pytest.approx(0.2, rel=1e-4)


def test_a_settled_point_vibrates_as_its_harmonics_say(backbone):
    for one, point in zip(backbone.experiments(rate_hz=1000.0), backbone.recording.points, strict=True):
        assert (one.initial_state, one.period_samples) == ("estimated", 0)
        assert one.inputs.shape[1] == round(30 * 1000.0 / point["frequency_hz"])
        turn = 2.0 * np.pi * point["frequency_hz"] / 1000.0 * np.arange(one.inputs.shape[1])
        orders = np.arange(1, 6)
        base = np.vstack([np.cos(np.outer(orders, turn)), np.sin(np.outer(orders, turn)), np.ones_like(turn)]).T
        found = np.linalg.lstsq(base, np.vstack([one.inputs, one.outputs]).T, rcond=None)[0]
        sizes = np.hypot(found[:5], found[5:10]).T
        wanted = np.abs(as_complex(point["harmonics"]))[:, 1:6]
        assert np.abs((sizes - wanted) / wanted.max(axis=1, keepdims=True)).max() < 2e-3
        assert one.level == point["force_n"]


def test_a_sweep_begins_at_rest_and_counts_from_its_own_beginning():
    with recorded_run(plan_from(SWEEP, "sweep"), seed=1) as run:
        first, second = run.experiments(rate_hz=1000.0)
        rows = point_rows(run.recording, 0)
    assert (first.initial_state, second.initial_state) == ("zero", "zero")
    assert first.counted_from == pytest.approx(40 / 18.0 * 1000, abs=60)  # ramp and hold, 20 periods each
    every_fifth = rows["inputs"][::5].T.astype(float)[:, : first.counted]
    for found, wanted in zip(np.vstack([first.counted_inputs, first.counted_outputs]), every_fifth, strict=True):
        assert np.abs(found - wanted).max() < 0.02 * np.abs(wanted).max()


def test_periods_and_stretches_with_lost_samples_are_left_out(monkeypatch):
    fs = 5000
    lose(monkeypatch, [(k * fs // 10, k * fs // 10 + 3) for k in (36, 86)])
    with rig.run(plan_from(LINES | {"resolution_hz": 1.0}, "lines"), seed=1) as run:
        kept = [one.counted // one.period_samples for one in run.experiments(periods="all")]
        assert kept == [2, 2]  # of three each
    with rig.run(plan_from(SWEEP | {"levels_v": [0.4]}, "sweep"), seed=1) as run:
        before, middle = run.experiments()[:2]
        assert (before.initial_state, middle.initial_state) == ("zero", "estimated")
        assert np.isfinite(middle.outputs).all()


def test_a_settled_point_of_which_no_stretch_is_left_is_not_used(monkeypatch):
    lose(monkeypatch, [(k, k + 1) for k in range(997, 400_000, 1009)])
    with (
        rig.run(plan_with(levels_v=(0.6,), record_periods=20), seed=1) as run,
        refused(IdentificationError, "long-enough"),
    ):
        run.experiments()


def test_points_that_were_not_accepted_are_never_used():
    with (
        rig.run(plan_with(levels_v=(0.6,), accepted_phase_error_deg=1e-6), seed=1) as run,
        refused(IdentificationError, "none-of-the-recording-was-accepted", field="points"),
    ):
        run.experiments()


@pytest.mark.parametrize("samples", [2.0, -3.0, 3.37, -0.5])
def test_skew_is_taken_out_of_records_of_any_length(samples):
    channels = bench_with().model_dump()["channels"]
    channels[1]["skew_samples"] = samples
    signals = Signals.chosen(bench_with({"channels": channels}), ["force"], ["drive"])
    at = np.arange(2000)
    recorded = np.cos(0.3 * (at - np.array([[0.0], [samples], [0.0], [0.0], [0.0]])))
    moved, spoilt = signals.in_step(recorded)
    inside = slice(spoilt, -spoilt)
    np.testing.assert_allclose(moved[1, inside], np.cos(0.3 * at)[inside], atol=1e-4)
    assert np.array_equal(moved[0], recorded[0])


def test_the_rate_is_a_round_number_near_25_a_period_and_at_most_the_recordings(multisine, backbone):
    assert default_rate_hz(multisine.recording) == 800.0  # below 25 x 35 Hz
    assert default_rate_hz(backbone.recording) == 500.0  # below 25 x 24 Hz
    fine = plan_from(LINES | {"resolution_hz": 0.4, "lowest_hz": 16.0, "highest_hz": 31.2}, "fine")
    with rig.run(fine, seed=1) as run:
        period = default_rate_hz(run.recording) / 0.4
        assert period == pytest.approx(round(period), abs=1e-9)
        assert period * 0.4 <= 25 * 31.2


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (
            {"rate_hz": 9000.0},
            {"field": "rate_hz", "value": 9000.0, "allowed": "up to 5000 Hz, as fast as was recorded"},
        ),
        ({"rate_hz": 800.2}, {"says": "whole-multiples-of-hz", "field": "rate_hz", "value": 800.2}),
        ({"inputs": ["current"]}, {"says": "there-is-no-channel-current-channels", "field": "inputs"}),
        ({"outputs": ["force"]}, {"says": "force-is-an-input-already", "field": "outputs"}),
        ({"outputs": []}, {"says": "none-given", "field": "outputs"}),
        ({"periods": "some"}, {"field": "periods", "value": "some", "allowed": "mean, all"}),
        ({"transient_periods": -1.0}, {"field": "transient_periods", "value": -1.0}),
        ({"segment_periods": 3}, {"field": "segment_periods", "value": 3, "allowed": "8 and above"}),
    ],
)
def test_what_cannot_be_is_refused_by_name(multisine, asked, said):
    with refused(IdentificationError, **said):
        multisine.experiments(**asked)


def test_a_continuous_backbone_holds_no_experiments(multisine, monkeypatch):
    monkeypatch.setattr(multisine.recording, "kind", "continuous-backbone")
    with refused(RecordingError, "holds-continuous-backbone-wanted-is-mult"):
        experiments(multisine.recording)


def test_the_high_pass_of_the_sensors_is_taken_out_of_a_multisine(multisine):
    """The exact inverse of a first-order high-pass at every line; the phase of the lowest is 18 times that of the highest."""
    part = multisine.recording
    (made, _) = multisine.experiments(rate_hz=5000.0, outputs=["drive"])
    rows = point_rows(part, 0)["inputs"][:30000].astype(float).reshape(3, 10000, -1).mean(axis=0)
    lines = np.arange(4, 1000)
    force, drive = (np.fft.rfft(rows[:, column])[lines] for column in (0, 1))
    corrected = np.fft.rfft(made.counted_inputs[0])[lines], np.fft.rfft(made.counted_outputs[0])[lines]
    inverse = 1.0 + 0.3 / (1j * lines * 0.5)
    for raw, found in zip((force, drive), corrected, strict=True):
        # the record begins somewhere in the period, the experiment where the signal begins
        np.testing.assert_allclose(np.abs(found), np.abs(raw * inverse), rtol=1e-9)
    np.testing.assert_allclose(corrected[1] / corrected[0], drive / force, rtol=1e-9)
    turned = np.unwrap(np.angle(corrected[1][30:66] / (drive * inverse)[30:66]))
    np.testing.assert_allclose(np.diff(turned, 2), 0.0, atol=1e-8)  # nothing is left but a shift in time


def test_the_high_pass_of_the_sensors_is_taken_out_of_a_sweep(multisine):
    rate_hz, corner_hz = 5000.0, 0.3
    times = np.arange(0.0, 40.0, 1.0 / rate_hz)
    true = np.sin(2.0 * np.pi * (10.0 + 0.4 * times) * times) * np.sin(np.pi * times / 40.0) ** 2
    x = 2.0 * np.pi * corner_hz / rate_hz  # exact for straight lines between the samples
    hold, held, late = np.exp(-x), -np.expm1(-x), 1.0 + np.expm1(-x) / x
    passed = true - lfilter([late, held - late], [1.0, -hold], true)
    bench = bench_with({"sample_rate_hz": rate_hz})
    signals = Signals.chosen(bench, ["force"], ["drive"])
    found = signals.without_high_pass(np.vstack([np.tile(passed, (len(bench.channels), 1)), true]))
    assert {channel.high_pass_hz for channel in bench.channels} == {corner_hz}
    assert np.linalg.norm(passed - true) > 0.01 * np.linalg.norm(true)
    assert np.all(np.linalg.norm(found[:-1] - true, axis=1) < 1e-3 * np.linalg.norm(true))
    assert np.array_equal(found[-1], true)  # the voltage has none
