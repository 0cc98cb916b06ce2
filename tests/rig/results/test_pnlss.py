"""PNLSS models from the command line: identified, interrupted and resumed, shown, drawn, and asked for predictions."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from identification import Features, FitProgress
from rig.campaigns.plans import plan_from
from rig.results.files import load, save
from rig.results.pnlss.options import PnlssOptions
from rig.results.pnlss.views import draw_pnlss
from rig.show.progress import FitLines
from simulators import VirtualRig
from simulators.analysis import constant_force_response
from tests.recorded import recorded_at

BENCH = {"bench": "magnet-beam"}
PLANS = {
    "lines": BENCH
    | {"kind": "multisine", "lowest_hz": 15.0, "highest_hz": 35.0, "resolution_hz": 0.25, "realisations": 3}
    | {"transient_periods": 3, "periods": 2, "levels_rms_v": [0.2]},
    "sweep": BENCH
    | {"kind": "sweep", "start_hz": 20.0, "stop_hz": 29.0, "rate_hz_per_s": 1.0, "levels_v": [0.08, 0.3]},
    "stepped": BENCH
    | {"kind": "stepped-sine", "start_hz": 24.0, "stop_hz": 25.0, "steps": 4, "levels_v": [0.15], "record_periods": 10},
    "backbone": {"levels_v": [0.3], "record_periods": 40},
}
SWEEP_PLAN = "sweep.toml"
QUICK = "--model pnlss --iterations 8 --outputs drive"


@pytest.fixture(scope="session")
def recordings(tmp_path_factory) -> Path:
    """A folder with the recordings."""
    from tests.rig.campaigns.running.test_runs import plan_with

    folder = tmp_path_factory.mktemp("pnlss")
    (folder / SWEEP_PLAN).write_text(
        "\n".join(f"{name} = {json.dumps(value)}" for name, value in PLANS["sweep"].items())
    )
    for name, table in PLANS.items():
        plan = plan_with(**table) if name == "backbone" else plan_from(table, name)
        recorded_at(folder / f"{name}.h5", plan, seed=1)
    return folder


@pytest.fixture
def there(command, recordings, monkeypatch):
    """The command in the folder of the recordings."""
    monkeypatch.chdir(recordings)
    return command


@pytest.fixture
def force_model(there, recordings) -> Path:
    """A model from force to drive point."""
    path = recordings / "F.h5"
    if not path.exists():
        done = there(f"identify lines.h5 {QUICK} -o F.h5")
        assert done.status == 0, done.err
    return path


@pytest.mark.slow
def test_a_model_is_better_than_its_linear_start_on_data_that_were_held_out(there, force_model):
    told = json.loads(there("show F.h5 --json").out)
    assert (told["kind"], told["states"], told["sample_rate_hz"], told["outputs"]) == ("pnlss", 2, 800.0, ["drive"])
    assert [run["use"] for run in told["errors"]] == ["training", "training", "validation"]
    for run, before in zip(told["errors"], told["linear_errors"], strict=True):
        assert run["errors"]["drive"] < 0.8 * before["errors"]["drive"]
        assert not run["unbounded"]
    assert told["fit"]["validation_error"] == pytest.approx(told["errors"][2]["errors"]["drive"], rel=1e-6)
    assert told["poles"][0]["frequency_hz"] == pytest.approx(24.37, rel=1e-3)
    assert len(told["training"]) == 2
    assert max(run["range_use"] for run in told["errors"][:2]) == pytest.approx(1.0)


def test_files_give_back_the_model_to_the_bit(force_model, tmp_path):
    first = load(force_model)
    save(first, tmp_path / "again.h5")
    again = load(tmp_path / "again.h5")
    u = np.random.default_rng(0).normal(size=(1, 300))
    assert np.array_equal(first.model.simulate(u).outputs, again.model.simulate(u).outputs)
    assert again.fit.chosen == first.fit.chosen
    assert [run.row() for run in again.runs] == [run.row() for run in first.runs]
    assert np.array_equal(again.spectra.error, first.spectra.error)


def test_ctrl_c_keeps_what_was_reached_and_resume_ends_where_a_whole_fit_does(there, force_model, monkeypatch):
    def stop(self, at):
        if at.iteration == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(FitLines, "__call__", stop)
        done = there(f"identify lines.h5 {QUICK} -o half.h5")
    assert done.status == 1
    assert "half.h5, and --resume" in done.err
    half = load(force_model.parent / "half.h5")
    assert half.fit.interrupted
    assert half.fit.history.iterations == 3
    done = there("identify lines.h5 --model pnlss --iterations 8 -o half.h5 --resume")
    assert done.status == 0, done.err
    whole, resumed = load(force_model), load(force_model.parent / "half.h5")
    np.testing.assert_allclose(resumed.fit.history.training_error, whole.fit.history.training_error, rtol=1e-6)


def test_ctrl_c_before_there_is_anything_leaves_nothing_behind(there, recordings, monkeypatch):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.results.pnlss.identify.identify_pnlss", stop)
    assert there(f"identify lines.h5 {QUICK} -o early.h5").status == 130
    assert not list(recordings.glob("early*"))


def test_progress_is_told_every_tenth_iteration_where_there_is_no_terminal(there):
    done = there("identify lines.h5 --model pnlss --outputs drive --iterations 12 -o twelve.h5 --overwrite")
    lines = [line for line in done.err.splitlines() if line.startswith("iteration")]
    assert len(lines) == 1
    assert lines[0].startswith("iteration  10/12  training ")


def test_settled_points_of_a_backbone_join_the_multisine_at_its_rate(there, recordings):
    done = there(f"identify lines.h5 backbone.h5 {QUICK} -o with.h5 --overwrite")
    assert done.status == 0, done.err
    found = load(recordings / "with.h5")
    assert [run.use for run in found.runs].count("training") == 3
    segment = next(run for run in found.runs if run.name.startswith("backbone"))
    assert segment.error[0] < 0.1


def test_steady_peaks_are_those_of_the_rig(there, force_model):
    told = json.loads(there("predict F.h5 --frequency-response 0.05 -o steady.h5 --overwrite --json").out)
    response = told["frequency_responses"][0]
    truth = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.05)
    assert response["force"] == "pure-sine"
    assert any("force held constant has no harmonics" in note for note in told["notes"])
    assert response["peak_m"] == pytest.approx(np.abs(truth.drive_harmonics_m[:, 1]).max(), rel=0.05)


def test_sweeps_references_and_multisines_are_compared(there, force_model):
    line = "predict F.h5 --sweep sweep.h5 --reference stepped.h5 --multisine lines.h5 -o P.h5 --overwrite --json"
    told = json.loads(there(line).out)
    stepped, small, _ = told["errors"]
    assert (stepped["name"], small["name"]) == ("0.15 V", "sweep [1]")
    assert stepped["envelope_error"] < 0.05
    assert abs(small["peak_error"]) < 0.05
    assert small["range_use"] < 1.0
    assert [run["use"] for run in told["multisines"]] == ["training", "training", "validation"]
    shown = json.loads(there("show F.h5 --json").out)
    for run, known in zip(told["multisines"], shown["errors"], strict=True):
        assert run["errors"] == known["errors"]


def test_a_run_that_leaves_all_bounds_is_said_to_and_drawn(there, force_model, recordings):
    found = load(force_model).model
    cubic = found.with_features(Features.monomials(2, 1, [3], of=range(2)))
    largest_decaying = 0.5 * found.state_range.min()  # beyond, a state that turns grows: |x| <- (1 + g |x|^2) |x|
    growth = (1.0 - np.abs(np.linalg.eigvals(found.a)).max()) / largest_decaying**2
    radial = growth * np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    save(replace(cubic, e=radial), recordings / "wild.h5")
    done = there("predict wild.h5 --sweep sweep.h5 --multisine lines.h5 -o W.h5 --overwrite --json")
    assert done.status == 0, done.err
    assert "NaN" not in done.out
    assert "Infinity" not in done.out
    told = json.loads(done.out)
    assert told["errors"][0]["verdict"] == "inside the identified range"
    assert told["errors"][1]["verdict"] == "unbounded"
    assert told["errors"][1]["peak_error"] is None
    assert told["sweeps"][1]["unbounded"]
    assert 0.0 < told["sweeps"][1]["unbounded_at_s"] < 14.0
    assert all(run["unbounded"] for run in told["multisines"])
    assert "3 of 3 runs unbounded" in there("show W.h5").out
    assert there("plot W.h5 -o W.png").status == 0


def test_with_the_voltage_as_input_sweeps_are_predicted_from_the_voltage(there, recordings):
    line = "identify lines.h5 --model pnlss --input voltage --outputs force,drive --states 4 --iterations 3 -o V.h5 --overwrite"
    done = there(line)
    assert done.status == 0, done.err
    line = (
        f"predict V.h5 --sweep sweep.h5 --planned-sweep {SWEEP_PLAN} --voltage-response 0.1 -o VP.h5 --overwrite --json"
    )
    told = json.loads(there(line).out)
    assert told["sweeps"][0]["origin"] == "the recorded voltage"
    assert abs(told["errors"][0]["peak_error"]) < 0.05
    for recorded, planned in zip(told["sweeps"][:2], told["sweeps"][2:], strict=True):
        assert planned["peak_m"] == pytest.approx(recorded["peak_m"], rel=2e-3)
    (response,) = told["frequency_responses"]
    assert (response["name"], response["force_n"], response["voltage_v"]) == ("0.1 V", None, 0.1)
    assert any("of magnet-beam alone" in n for n in json.loads(there("show V.h5 --json").out)["notes"])


@pytest.mark.slow
def test_with_an_exciter_a_force_driven_model_follows_the_voltage(there, force_model, shelf):
    line = (
        f"predict F.h5 --sweep sweep.h5 --planned-sweep {SWEEP_PLAN} --exciter {shelf}/EX.h5 -o C.h5 --overwrite --json"
    )
    told = json.loads(there(line).out)
    assert told["sweeps"][0]["origin"] == "the recorded voltage"
    assert abs(told["errors"][0]["peak_error"]) < 0.02
    assert told["sweeps"][2]["peak_m"] == pytest.approx(told["sweeps"][0]["peak_m"], rel=2e-3)


def test_a_figure_shows_spectra_time_course_and_range_of_what_the_file_holds(there, force_model, recordings):
    assert there("plot F.h5 -o F.png").status == 0
    found = load(force_model)
    page = Figure(figsize=(12.0, 7.5), layout="constrained")
    draw_pnlss(page, found)
    spectra, time, history, runs = page.axes
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in spectra.get_lines()}
    np.testing.assert_allclose(lines["measured"], found.spectra.measured[0])
    assert (
        lines["residual, this model"].max()
        < 0.8 * lines["residual, linear model"].max()
        < 0.2 * lines["measured"].max()
    )
    top = int(np.argmax(lines["measured"]))
    assert lines["this model"][top] == pytest.approx(lines["measured"][top], rel=0.05)
    assert 0.0 < np.median(lines["noise"]) < 0.1 * lines["residual, this model"].max()
    measured, model, residual = (np.asarray(line.get_ydata()) for line in time.get_lines())
    assert np.abs(measured).max() == np.abs(found.stretch.measured[0]).max()
    np.testing.assert_allclose(residual, model - measured)
    assert np.linalg.norm(residual) < 0.05 * np.linalg.norm(measured)
    lengths = [len(line.get_xdata()) for line in history.get_lines()]
    assert lengths.count(found.fit.history.iterations + 1) == 2  # training, validation
    drawn = np.concatenate([line.get_xydata() for line in runs.get_lines() if len(line.get_xdata()) <= 3])
    for run in found.runs:
        assert np.any(np.isclose(drawn, run.range_use)), run.name
    page.clear()
    draw_pnlss(page, replace(found, runs=(), linear_runs=(), spectra=None, stretch=None))
    assert len(page.axes) == 1  # the course alone, no empty panels
    assert "not in the file: spectra, time series, errors of experiments" in page.get_suptitle().replace("\n", " ")


def test_a_response_that_is_cut_off_has_no_peak(there, force_model):
    told = json.loads(there("predict F.h5 --frequency-response 0.4 -o cut.h5 --overwrite --json").out)
    (response,) = told["frequency_responses"]
    assert (response["complete"], response["peak_m"], response["detached_branches"]) == (False, None, 0)
    truth = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.4)
    assert 0.0 < response["largest_m"] < truth.amplitude_m.max()
    assert " ends at " in response["notes"][0]
    row = next(line for line in there("show cut.h5").out.splitlines() if line.startswith("0.4 N"))
    assert f">= {1e3 * response['largest_m']:.5f}  -" in " ".join(row.split()).replace(" -", "  -", 1)


def test_saturating_features_take_the_place_of_the_monomials_unless_degrees_are_given():
    taken = {
        (options.chosen_degrees, options.saturating_features)
        for options in (
            PnlssOptions(saturating=3),
            PnlssOptions(saturating=3, degrees="3"),
            PnlssOptions(saturating=3, output_polynomials=False),
            PnlssOptions(degrees=""),
            PnlssOptions(),
        )
    }
    assert taken == {((), 3), ((3,), 3), ((), (3, 0)), ((), 0), ((2, 3), 0)}


def test_a_model_from_elsewhere_does_not_call_its_training_data_a_test(there, force_model, recordings):
    save(load(force_model).model, recordings / "elsewhere.h5")
    told = json.loads(there("predict elsewhere.h5 --multisine lines.h5 -o E.h5 --overwrite --json").out)
    assert {run["use"] for run in told["multisines"]} == {"unknown"}
    assert any("does not say" in note for note in told["notes"])


def test_progress_says_which_start_is_compared(capsys):
    lines = FitLines()
    at = FitProgress(
        iteration=10,
        iterations=10,
        training_error=0.01,
        validation_error=0.02,
        damping=1.0,
        seconds=1.0,
        stage="start 3 of 8",
    )
    lines(at)
    lines(replace(at, stage="", training_error=0.5, validation_error=0.6, iteration=20, iterations=40))
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("start 3 of 8: iteration  10/10  ")
    assert second.startswith("iteration  20/40  ")
    assert "best at 20" in second  # not that of a start


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("identify lines.h5 --model linear --states 2", "--states: does not apply to --model linear"),
        ("identify lines.h5 --model pnlss --count 2", "--count: does not apply to --model pnlss, which takes --states"),
        ("identify lines.h5 --model pnlss --degrees 1,3", "--degrees = '1,3': allowed are whole numbers from 2 to 12"),
        ("identify lines.h5 --model pnlss --input current", "--input = 'current': allowed are force, voltage"),
        ("identify lines.h5 --model pnlss --rate 0", "--rate = 0: allowed is any number above 0"),
        ("identify lines.h5 --model pnlss --rate 9000", "--rate = 9000 Hz; allowed: up to 5000 Hz"),
        ("identify lines.h5 --model pnlss --outputs nothing", "outputs: there is no channel nothing"),
        (
            "identify lines.h5 --model pnlss --validation sweep.h5 --hold-out 1",
            "--hold-out: is instead of --validation",
        ),
        ("identify lines.h5 --model pnlss --resume", "X.h5: there is nothing to resume"),
        ("identify lines.h5 --model pnlss --states 0", "--states = 0: allowed is 1 and above"),
        (
            "identify F.h5 --model pnlss",
            "F.h5: is a file of kind pnlss; a PNLSS model comes from recordings: backbone, ",
        ),
        ("identify backbone.h5 --model pnlss", "backbone.h5 (backbone): no multisine among them"),
        (
            "identify lines.h5 --model pnlss --rate 60",
            "--rate = 60 Hz: lines.h5 is excited up to 35 Hz; allowed: above",
        ),
        (
            "identify sweep.h5 lines.h5 --model pnlss --rate 777.7",
            "sweep.h5 was recorded at 5000 Hz; allowed: ratios of",
        ),
        (
            "identify lines.h5 --model pnlss --validation lines.h5",
            "lines.h5: is among the files that the model is fitted to",
        ),
        ("identify lines.h5 --model pnlss --function cube", "--function = cube: is of features; add --saturating"),
        (
            "identify lines.h5 --model pnlss --saturating 2 --function sinus",
            "allowed are tanh, square, cube, or module:name",
        ),
        (
            "identify lines.h5 --model pnlss --saturating 2 --function mine:g",
            "--function = mine:g: is code, and is not imported unless you trust it: --trust-code",
        ),
        ("identify lines.h5 --model linear --constant-input", "--constant-input: does not apply to --model linear"),
        ("predict F.h5 --multisine lines.h5 --constant force=1", "--constant: hold all inputs of F.h5"),
        (
            "predict F.h5 --planned-multisine magnet-beam/multisine-1",
            "--planned-multisine: gives a voltage, and F.h5 is",
        ),
        ("identify lines.h5 --model pnlss --hold-out 3", "no level has more than 3 realisations; allowed is 0 to 2"),
        (
            "predict lines.h5 --frequency-response 0.1",
            "is a file of kind multisine; predictions are made with a ",
        ),
        ("predict F.h5 --frequency-response 0", "--frequency-response = 0: allowed is any number above 0, N"),
        ("predict F.h5 --sweep sweep.h5 --sweep sweep.h5", "--sweep = sweep.h5: is given twice"),
        ("predict F.h5 --voltage-response 0.1", "--voltage-response: gives a voltage, and F.h5 is driven by a force"),
        (
            f"predict F.h5 --planned-sweep {SWEEP_PLAN}",
            "--planned-sweep: gives a voltage, and F.h5 is driven by a force; add --exciter",
        ),
        ("predict F.h5 --multisine lines.h5 --exciter F.h5", "--exciter: does not apply to --multisine"),
        ("predict F.h5 --sweep lines.h5", "lines.h5: holds a multisine, expected a sweep recording"),
        ("predict F.h5 --multisine sweep.h5", "sweep.h5: holds a sweep, expected a multisine recording"),
        ("predict F.h5 --frequency-response 0.1 --modes F.h5", "--modes: does not apply to a PNLSS model"),
        (
            "predict F.h5 --sweep sweep.h5 --exciter F.h5",
            "F.h5: is a file of kind pnlss, expected one of kind exciter",
        ),
        (
            "predict F.h5 --frequency-response 0.1 --force rms",
            "force: 'rms' of a model driven by a force needs an exciter",
        ),
    ],
)
def test_mistakes_are_named_in_one_line(there, force_model, line, said):
    done = there(f"{line} -o X.h5")
    assert done.status == 1
    assert said in done.err
    assert done.err.count("\n") == 1


def test_a_fit_goes_on_with_its_own_data_alone(there, force_model, recordings):
    before = (recordings / "F.h5").read_bytes()
    for other in ("lines.h5 backbone.h5", "lines.h5 --hold-out 2", "lines.h5 --relative-errors"):
        done = there(f"identify {other} --model pnlss --iterations 9 -o F.h5 --resume")
        assert done.status == 1
        assert "F.h5: was fitted to other" in done.err
    assert "8 are done; allowed is more" in there("identify lines.h5 --model pnlss --iterations 8 -o F.h5 --resume").err
    assert (recordings / "F.h5").read_bytes() == before


def test_a_pure_sine_says_that_the_references_force_was_none(there, force_model):
    told = json.loads(there("predict F.h5 --reference stepped.h5 -o S.h5 --overwrite --json").out)
    assert any(
        note.startswith("the forces differ: the reference's has F2/F1 = 0.0") for note in told["errors"][0]["notes"]
    )


def test_options_of_a_fit_that_goes_on_are_its_own(there, force_model):
    done = there("identify lines.h5 --model pnlss --states 3 -o F.h5 --resume")
    assert "--states: " in done.err


def test_relative_errors_weigh_small_levels_as_large_ones(there, recordings):
    for name, option in (("as-they-are", ""), ("relative", "--relative-errors")):
        done = there(f"identify lines.h5 backbone.h5 {QUICK} {option} -o {name}.h5 --overwrite")
        assert done.status == 0, done.err
    levels = {name: load(recordings / f"{name}.h5") for name in ("as-they-are", "relative")}
    lines = {name: next(r for r in found.runs if r.name.startswith("lines")) for name, found in levels.items()}
    assert lines["relative"].error[0] < lines["as-they-are"].error[0]
