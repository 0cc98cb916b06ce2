"""Structured models from the command line: identified, kept in a file, shown, drawn, and asked for predictions."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

import rig
from identification import ElementTrial, MissingForce, NonlinearElement
from identification.models import LAWS, BoucWen, Iwan, Jenkins, PolynomialSpring, UserSpring
from rig.campaigns.plans import plan_from
from rig.errors import RecordingError
from rig.results.files import load, save
from rig.results.simulated.table import noise_verdict
from rig.results.structured.figure import draw_structured
from rig.results.structured.model import IdentifiedStructured
from rig.results.structured.options import StructuredOptions
from tests.recorded import recorded_at
from tests.refused import refused
from tests.rig.exchange.structured_models import structure
from tests.sharing import copy_of, made_once, shared_folder

LINES = {"bench": "magnet-beam", "kind": "multisine", "lowest_hz": 15.0, "highest_hz": 35.0, "resolution_hz": 0.25}
LINES |= {"transient_periods": 3, "periods": 2, "realisations": 2}


@pytest.fixture(scope="session")
def recordings(tmp_path_factory) -> Path:
    """A folder with recordings at two levels, the modes of the lower one, and a model of the higher one."""
    return copy_of(made_once(shared_folder() / "structured", _fill), tmp_path_factory.mktemp("structured"))


def _fill(folder: Path) -> None:
    from rig.results.identify import identify_model
    from rig.results.linear_modes.options import LinearOptions

    for name, level in (("low", 0.02), ("lines", 0.4)):
        recorded_at(folder / f"{name}.h5", plan_from(LINES | {"levels_rms_v": [level]}, name), seed=1)
    save(identify_model([folder / "low.h5"], LinearOptions(count=1)), folder / "modes.h5")
    options = StructuredOptions(modes=folder / "modes.h5", laws=("polynomial-spring",), rate_hz=200.0, outputs="drive")
    save(identify_model([folder / "lines.h5"], options), folder / "S.h5")


@pytest.fixture
def there(command, recordings, monkeypatch):
    """The command in the folder of the recordings."""
    monkeypatch.chdir(recordings)
    return command


@pytest.mark.slow
def test_a_model_becomes_a_rig_like_the_bench_of_its_recording(there, recordings):
    there("new rig --from S.h5 --bench lines.h5 -o mine.toml")
    there("new rig --from S.h5 --bench magnet-beam -o other.toml")
    mine, other = (rig.load_bench(recordings / f"{name}.toml") for name in ("mine", "other"))
    assert mine.model_copy(update={"name": "other"}) == other
    assert [channel.name for channel in mine.channels] == ["force", "drive"]
    assert mine.driver.options["exciter"]["force_factor_n_a"] == 5.3


def test_a_model_is_better_than_its_linear_start_on_data_that_were_held_out(there):
    told = json.loads(there("show S.h5 --json").out)
    assert (told["kind"], told["sample_rate_hz"], told["outputs"]) == ("structured", 200.0, ["drive"])
    assert [run["use"] for run in told["errors"]] == ["training", "validation"]
    for run, before in zip(told["errors"], told["linear_errors"], strict=True):
        assert run["errors"]["drive"] < 0.3 * before["errors"]["drive"]
    assert told["fit"]["training_error"] == pytest.approx(told["errors"][0]["errors"]["drive"], rel=0.5)
    assert told["errors"][0]["range_use"] == pytest.approx(1.0)
    assert told["modes"][0]["frequency_hz"] == pytest.approx(24.37, rel=1e-3)
    assert 0.0 < told["modes"][0]["frequency_std_hz"] < 0.1
    assert [law["kind"] for law in told["elements"][0]["laws"]] == ["polynomial-spring"]
    assert 0.0 < told["elements"][0]["largest_m"] < told["elements"][0]["reach_m"]
    assert "polynomial-spring" in there("show S.h5").out


def test_small_vibrations_are_shown_with_stuck_joints_and_what_was_fitted_beside_them(there, recordings):
    sliding = json.loads(there("show S.h5 --json").out)
    assert sliding["linear_part"] is None  # a polynomial spring has no slope at rest
    found = load(recordings / "S.h5")
    (element,) = found.model.elements
    joint = replace(element, laws=(*element.laws, Jenkins(0.05, 0.2)))
    save(replace(found.model, elements=(joint,)), recordings / "joint.h5")
    stuck = json.loads(there("show joint.h5 --json").out)
    own = (2.0 * np.pi * found.model.frequency_hz) ** 2
    matrix = np.diag(own) + 0.05 / element.scale_m * np.outer(element.direction, element.direction)
    matrix_hz = np.sqrt(np.linalg.eigvalsh(matrix)) / (2.0 * np.pi)
    assert [mode["frequency_hz"] for mode in stuck["modes"]] == pytest.approx(matrix_hz, rel=1e-3)
    assert [mode["frequency_hz"] for mode in stuck["linear_part"]] == pytest.approx(found.model.frequency_hz)
    said = there("show joint.h5").out
    assert said.index("small vibrations, all joints stuck") < said.index("fitted linear part, all joints slipping")


def test_errors_of_modes_that_no_law_moves_are_those_of_the_fit(there, recordings):
    fit = load(recordings / "S.h5").fit
    errors = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
    assert "frequency 1" in errors
    assert "frequency 2" not in errors  # the residual's, above half the sample rate
    for index, mode in enumerate(json.loads(there("show S.h5 --json").out)["modes"], 1):
        of_frequency, of_damping = (errors.get(f"{name} {index}", 0.0) for name in ("frequency", "damping"))
        assert mode["frequency_std_hz"] == pytest.approx(of_frequency * mode["frequency_hz"], rel=1e-2, abs=1e-9)
        assert mode["damping_ratio_std"] == pytest.approx(of_damping * mode["damping_ratio"], rel=1e-2, abs=1e-12)


def test_models_that_a_selection_fitted_are_listed_in_their_order(there, recordings):
    found = load(recordings / "S.h5")
    of = {"laws": ("jenkins",), "between": (), "at_least": 2.0}
    trials = (
        ElementTrial(**of, elements=("stop@drive",), error=0.4, gain=np.nan, kept=False),
        ElementTrial(**of, elements=("jenkins",), error=0.05, gain=np.nan, kept=True),
        ElementTrial(
            **of,
            elements=("jenkins", "stop@drive"),
            compared=("jenkins",),
            error=0.0125,
            gain=4.0,
            likelihood=12.5,
            kept=True,
        ),
    )
    save(replace(found, fit=replace(found.fit, trials=trials)), recordings / "selected.h5")
    np.testing.assert_equal(asdict(load(recordings / "selected.h5").fit.trials[2]), asdict(trials[2]))
    said = there("show selected.h5").out.splitlines()
    at = said.index("models that were fitted, 3, by the elements that they have")
    assert [line.split() for line in said[at + 2 : at + 5]] == [
        ["stop@drive", "40", "-", "-", "-", "-"],
        ["jenkins", "5", "-", "-", "-", "kept"],
        ["jenkins", "+", "stop@drive", "1.25", "4", "jenkins", "12.5", "kept"],
    ]
    assert "models that were fitted" not in there("show S.h5").out  # one alone is no selection


@pytest.mark.parametrize(
    ("numbers", "share", "said"),
    [
        (0.1, 0.9, "a joint at tip"),
        (0.1, 0.98, "a joint at tip or tip:drive, which the data do not tell apart"),
        (0.9, 0.2, "other values of the model's own numbers, so that its fit ended in a local minimum"),
        (0.1, 0.4, "no spring, damper or joint at an output or along a mode"),
    ],
)
def test_what_would_explain_the_residual_is_named(there, recordings, numbers, share, said):
    found = load(recordings / "S.h5")
    missing = (
        MissingForce(force="numbers", place="", share=numbers),
        MissingForce(force="joint", place="tip", share=share),
        MissingForce(force="joint", place="tip:drive", share=0.975 if share > 0.975 else 0.15),
        *(MissingForce(force="spring", place="drive", share=0.1 / k) for k in range(1, 6)),
    )
    save(replace(found, fit=replace(found.fit, missing=missing)), recordings / "lacking.h5")
    assert load(recordings / "lacking.h5").fit.missing == missing
    lines = there("show lacking.h5").out.splitlines()
    at = lines.index(f"what would explain the residual of the training data: {said}")
    assert [line.rsplit(maxsplit=2)[-2:] for line in lines[at + 3 : at + 7]] == [
        ["tip", f"{100.0 * share:.1f}"],
        ["tip:drive", "97.5" if share > 0.975 else "15.0"],
        *(["drive", f"{10.0 / k:.1f}"] for k in range(1, 3)),
    ]
    assert "what would explain" not in there("show S.h5").out


def test_laws_that_were_tried_are_listed_and_it_is_said_if_none_explains_the_data(there, recordings):
    found = load(recordings / "S.h5")
    of = {"between": (), "at_least": np.nan, "gain": np.nan}
    tried = {"laws": ("stop",), "elements": ("stop below",), "regression": 0.5, "screening": 0.25}
    best = ElementTrial(**of, **tried, error=0.05, over_noise=40.0, kept=True)
    others = (
        ElementTrial(**of, laws=(), elements=("linear",), regression=1.0, screening=0.5, error=np.nan, kept=False),
        ElementTrial(**of, laws=("jenkins",), elements=("jenkins",), regression=0.99, error=np.nan, kept=False),
    )
    for name, first in (("wrong", best), ("right", replace(best, over_noise=1.5))):
        fit = replace(found.fit, trials=(first, *others))
        save(replace(found, fit=fit), recordings / f"{name}.h5")
    said = there("show wrong.h5").out.splitlines()
    at = said.index("laws that were tried, 3")
    assert [line.split() for line in said[at + 2 : at + 5]] == [
        ["stop", "below", "50", "25", "5", "40", "-", "-", "-", "kept"],
        ["linear", "100", "50", "-", "-", "-", "-", "-", "-"],
        ["jenkins", "99", "-", "-", "-", "-", "-", "-", "-"],
    ]
    assert said[at + 5].startswith("none of these laws explains the data: the best leaves 5 % in validation, 40 times")
    assert "none of these laws" not in there("show right.h5").out


def test_a_model_without_an_element_is_shown_and_drawn(there, recordings):
    found = load(recordings / "S.h5")
    save(IdentifiedStructured(model=replace(found.model, elements=()), runs=found.runs), recordings / "linear.h5")
    assert "no element: a linear structure" in there("show linear.h5").out
    there("plot linear.h5 -o linear.png")


def test_numbers_that_the_data_do_not_tell_are_said_to_be_not_identified(there, recordings):
    found = load(recordings / "S.h5")
    fit, at = found.fit, found.fit.names.index("element 1 polynomial-spring coefficients_n[0]")
    values, covariance = fit.values.copy(), fit.covariance.copy()
    values[at], covariance[at, at] = 2.0, 1.5**2
    changed = replace(fit, values=values, covariance=covariance, unseen=("support",))
    save(replace(found, fit=changed), recordings / "unknown.h5")
    assert load(recordings / "unknown.h5").fit.not_identified == changed.not_identified
    told = json.loads(there("show unknown.h5 --json").out)
    assert {fit.names[at], "support"} <= set(told["not_identified"])
    said = [line.split() for line in there("show unknown.h5").out.splitlines()]
    assert [*fit.names[at].split(), "not", "identified:", "wide", "-0.94", "4.94"] in said
    assert ["support", "not", "identified:", "no", "effect", "-", "-"] in said
    known = fit.names[at + 1] if fit.names[at + 1] not in fit.not_identified else None
    assert known is None or not any(line[:4] == known.split() and "not" in line for line in said)


def test_the_residual_is_compared_with_the_noise(there):
    said = there("show S.h5").out.splitlines()
    (heading,) = (line for line in said if "range use" in line)
    assert heading.split()[-1] == "residual/noise"
    training, *_ = (run for run in json.loads(there("show S.h5 --json").out)["errors"] if run["use"] == "training")
    assert 0.3 < training["over_noise"]["drive"] < 3.0
    assert said[-1] == noise_verdict([training])


def _run(use="training", error=0.01, **over_noise):
    return {"name": f"{use} data", "use": use, "over_noise": over_noise, "errors": dict.fromkeys(over_noise, error)}


def test_the_verdict_names_the_output_and_the_experiment_with_the_largest_residual():
    assert noise_verdict([_run(drive=None)]) == noise_verdict([_run("validation", drive=50.0)]) == ""
    assert "at most 2.9 times" in noise_verdict([_run(drive=2.9, tip=1.0), _run("validation", drive=50.0)])
    said = noise_verdict([_run(drive=2.9, tip=41.2), _run(drive=3.1)])
    assert "41.2 times the noise, 1 % (tip, training data): the model lacks something" in said
    small = noise_verdict([_run(error=8.5e-4, drive=7.5)])
    assert small == "the residual is 7.5 times the noise, but small, 0.085 % (drive, training data)"
    assert "3.5 times the noise, 1 %" in noise_verdict([_run(error=8.5e-4, drive=7.5), _run(drive=3.5)])


def test_multisines_have_the_errors_of_the_file(there):
    told = json.loads(there("predict S.h5 --multisine lines.h5 -o P.h5 --overwrite --json").out)
    shown = json.loads(there("show S.h5 --json").out)
    assert [run["use"] for run in told["multisines"]] == ["training", "validation"]
    for run, known in zip(told["multisines"], shown["errors"], strict=True):
        assert run["errors"] == known["errors"]
        assert run["range_use"] == known["range_use"]
    fresh = json.loads(there("predict S.h5 --multisine low.h5 -o P.h5 --overwrite --json").out)["multisines"]
    assert {run["use"] for run in fresh} == {"test"}
    assert all(run["range_use"] < 0.2 for run in fresh)


@pytest.mark.slow
def test_every_recording_has_shifts_of_its_own(there, recordings):
    (recordings / "restless.toml").write_text('base = "magnet-beam"\n[driver.options.scatter]\nfrequency = 0.001\n')
    for seed in (2, 3):
        plan = plan_from(LINES | {"bench": str(recordings / "restless.toml"), "levels_rms_v": [0.4]}, "restless")
        rig.run(plan, output=recordings / f"restless{seed}.h5", seed=seed, overwrite=True).close()
    of = "--model structured --modes modes.h5 --laws polynomial-spring --rate 200 --outputs drive"
    line = f"identify restless2.h5 restless3.h5 {of} --scatter frequency -o T.h5 --overwrite"
    told = json.loads(there(f"{line} --json").out)
    (width,) = told["scatter"]
    assert (width["effect"], width["recordings"]) == ("frequency 1", 2)
    assert width["width_low"] < 0.001 < width["width_high"]
    found = load(recordings / "T.h5")
    one, other = (found.scatter.model_of(found.model, run).frequency_hz[0] for run in found.scatter.runs)
    assert abs(one / other - 1.0) > 1e-4
    assert max(run["errors"]["drive"] for run in told["errors"]) < 0.03
    assert "shifts from run to run, 2 runs" in there("show T.h5").out


def test_a_file_gives_back_fit_and_errors_to_the_bit(recordings, tmp_path):
    first = load(recordings / "S.h5")
    save(first, tmp_path / "again.h5")
    again = load(tmp_path / "again.h5")
    u = np.random.default_rng(0).normal(size=(1, 300))
    for name in ("model", "linear"):
        one, other = (getattr(found, name).simulate(u).outputs for found in (first, again))
        assert np.array_equal(one, other)
    assert again.fit.names == first.fit.names
    assert np.array_equal(again.fit.covariance, first.fit.covariance)
    assert again.fit.start.elements[0].laws[0].as_dict() == first.fit.start.elements[0].laws[0].as_dict()
    assert [run.row() for run in again.runs] == [run.row() for run in first.runs]
    assert np.array_equal(again.spectra.error, first.spectra.error)
    assert (again.fit.message, again.uses, again.data) == (first.fit.message, first.uses, first.data)


def test_elements_of_all_laws_come_back_from_a_model_alone(tmp_path):
    sent = structure()
    save(sent, tmp_path / "m.h5")
    found = load(tmp_path / "m.h5")
    assert found.fit is None
    assert [law.as_dict() for e in found.model.elements for law in e.laws] == [
        law.as_dict() for e in sent.elements for law in e.laws
    ]
    u = np.random.default_rng(0).normal(size=(1, 300))
    assert np.array_equal(found.model.simulate(u).outputs, sent.simulate(u).outputs)


def test_models_and_fits_draw_and_show_themselves(recordings):
    fit = load(recordings / "S.h5").fit
    for one in (fit, fit.model):
        (axis,) = one.plot()
        assert axis.get_xlabel() == "displacement of element 1, mm"
        assert "polynomial-spring" in one._repr_html_()


def drawn(found):
    page = Figure(figsize=(12.0, 7.5), layout="constrained")
    draw_structured(page, found)
    lines = {axis.get_xlabel(): axis for axis in page.axes}
    return page, lines


def test_a_figure_shows_spectra_time_course_the_element_and_errors(there, recordings):
    assert there("plot S.h5 -o S.png").status == 0
    found = load(recordings / "S.h5")
    page, axes = drawn(found)
    assert {"frequency, Hz", "time, s", "displacement of element 1, mm", "range use"} == set(axes)
    (element,) = found.model.elements
    axis = axes["displacement of element 1, mm"]
    (spring,) = [line for line in axis.get_lines() if line.get_label() == "spring"]
    z, force = spring.get_data()
    np.testing.assert_allclose(force, element.laws[0].force(z / (1e3 * element.scale_m)), rtol=1e-12, atol=1e-12)
    assert axis.get_ylabel() == "force, N"
    (span,) = axis.patches
    assert span.get_x() + span.get_width() == pytest.approx(1e3 * element.scale_m * element.largest)
    page, axes = drawn(replace(found, runs=(), spectra=None, stretch=None))
    assert len(page.axes) == 1
    assert "not in the file: spectra, time series, errors of experiments" in page.get_suptitle().replace("\n", " ")


def test_the_loop_of_a_joint_is_that_of_its_sliders_moved_slowly():
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(Jenkins(0.5, 0.3), Iwan(0.2)), largest=1.2)
    _, axes = drawn(IdentifiedStructured(model=structure(elements=(element,))))
    (line,) = [line for line in axes["displacement of element 1, mm"].get_lines() if line.get_label() == "joint"]
    z, force = line.get_data()
    stiffness, strength = np.concatenate([law.sliders() for law in element.laws], axis=1)
    pulled, before, moved = np.zeros(strength.size), 0.0, []
    for x in np.concatenate([np.linspace(0.0, z[0], 50), z, z]):  # to the first end, and two cycles
        pulled = np.clip(pulled + stiffness * (x - before), -strength, strength)
        before = x
        moved.append(pulled.sum())
    np.testing.assert_allclose(force, moved[-z.size :], rtol=1e-9, atol=1e-12)


def test_the_loop_of_a_hysteresis_that_softens_ends_at_its_largest_force():
    law = BoucWen(2.0, 0.1, 2.0, 0.5)
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(law,), largest=1.2)
    _, axes = drawn(IdentifiedStructured(model=structure(elements=(element,))))
    (line,) = [line for line in axes["displacement of element 1, mm"].get_lines() if line.get_label() == "joint"]
    z, force = line.get_data()
    assert np.max(np.abs(force)) == pytest.approx(0.2 * 1.5**-0.5, rel=1e-6)
    assert abs(np.trapezoid(force, z)) > 0.8 * 4.0 * 1.2 * 0.2 * 1.5**-0.5


def test_functions_that_a_file_names_are_imported_by_predictions_of_who_trusts_them_alone(
    there, recordings, monkeypatch
):
    (recordings / "own_law_of_a_test.py").write_text("def cubic(x, numbers):\n    return numbers[0] * x**3\n")
    monkeypatch.syspath_prepend(recordings)
    found = load(recordings / "S.h5")
    (element,) = found.model.elements
    law = UserSpring("own_law_of_a_test:cubic", (element.laws[0].coefficients_n[1],))
    own = replace(found.model, elements=(replace(element, laws=(law,)),))
    save(own, recordings / "own.h5")
    shown = there("show own.h5")
    assert "own_law_of_a_test:cubic: " in shown.out
    for line in ("plot own.h5 -o own.png", "export own.h5 -o own.mat"):
        assert there(line).status == 0
    refused = there("predict own.h5 --multisine lines.h5 -o O.h5")
    assert "'own_law_of_a_test:cubic'" in refused.err
    assert refused.err.endswith("--trust-code\n")
    over = there("plot own.h5 S.h5 -o over.png")
    assert "not imported to draw" in over.err
    assert json.loads(there("show own.h5 --json").out)["modes"] is None
    assert "own_law_of_a_test" not in sys.modules
    done = there("predict own.h5 --multisine lines.h5 --trust-code -o O.h5 --overwrite --json")
    assert done.status == 0, done.err
    assert "own_law_of_a_test" in sys.modules
    cubic = PolynomialSpring((0.0, element.laws[0].coefficients_n[1]))
    save(replace(own, elements=(replace(element, laws=(cubic,)),)), recordings / "same.h5")
    same = json.loads(there("predict same.h5 --multisine lines.h5 -o O.h5 --overwrite --json").out)
    for one, other in zip(json.loads(done.out)["multisines"], same["multisines"], strict=True):
        assert one["errors"]["drive"] == pytest.approx(other["errors"]["drive"], rel=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda told: told["model"]["elements"][0]["laws"][0].update(kind="magic"), {"says": "kind-is-magic-allowed"}),
        (lambda told: told["model"]["elements"][0].pop("laws"), {"says": "laws-is-missing-or-unknown"}),
        (lambda told: told["model"]["elements"][0].update(laws=[3]), {"says": "does-not-hold-what-makes-a"}),
        (lambda told: told["model"].update(steps="many"), {"says": "does-not-hold-what-makes-a"}),
        (lambda told: told["model"].update(later=1), {"says": "is-missing-or-unknown"}),
        (lambda told: told.pop("model"), {"says": "holds-neither-a-fit-nor-a"}),
        (lambda told: told.pop("runs"), {"says": "runs-is-missing"}),
    ],
)
def test_what_is_no_such_file_is_named(change, said, tmp_path):
    from rig.recording.arrays import read_arrays, write_arrays

    save(structure(), tmp_path / "m.h5")
    kind, arrays, attributes = read_arrays(tmp_path / "m.h5")
    change(attributes)
    write_arrays(tmp_path / "m.h5", kind, arrays, attributes)
    with refused(RecordingError, **said):
        load(tmp_path / "m.h5")


def test_a_file_that_lacks_an_array_is_named(tmp_path):
    save(structure(), tmp_path / "m.h5")
    with h5py.File(tmp_path / "m.h5", "r+") as file:
        del file["arrays/model/direct"]
    with refused(RecordingError, "message"):
        load(tmp_path / "m.h5")


def test_every_law_but_a_function_of_ones_own_is_an_option_and_in_the_how_to():
    page = (Path(__file__).parents[3] / "docs/how-to/identify-a-structured-model.md").read_text(encoding="utf-8")
    for name in sorted(set(LAWS) - {"user-spring"}):
        ((law,),) = [plan.laws for plan in StructuredOptions(modes="m.h5", laws=(name,)).elements()]
        assert isinstance(law, LAWS[name])
        assert f"`{name}`" in page


def test_laws_are_chosen_at_a_place():
    options = StructuredOptions(modes="m.h5", laws=("auto @ drive : base",))
    assert options.arguments() == {"laws": "auto", "between": ("drive", "base")}


@pytest.mark.parametrize(
    ("place", "between"), [("", ()), ("@drive", ("drive",)), ("@ drive : base", ("drive", "base"))]
)
def test_an_element_acts_at_the_outputs_after_its_laws(place, between):
    (plan,) = StructuredOptions(modes="m.h5", laws=(f"polynomial-spring, masing{place}",)).elements()
    assert [type(law) for law in plan.laws] == [LAWS["polynomial-spring"], LAWS["masing"]]
    assert plan.between == between


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "identify lines.h5 --model structured",
            "--modes: is missing, the modes with which a structured model begins; make",
        ),
        (
            "identify lines.h5 --model structured --modes no.h5",
            "no.h5: does not exist, expected the modes with which",
        ),
        (
            "identify lines.h5 --model structured --modes low.h5",
            "low.h5: is a file of kind multisine, expected the modes",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --states 2",
            "--states: does not apply to --model structured",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --input force",
            "--input: does not apply to --model struct",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --resume",
            "--resume: does not apply to --model structured",
        ),
        ("identify lines.h5 --model pnlss --laws iwan", "--laws: does not apply to --model pnlss"),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws magic",
            "--laws = 'magic': allowed are polynomial-spring, ",
        ),
        (
            "identify S.h5 --model structured --modes modes.h5",
            "S.h5: is a file of kind structured; a structured model comes from recordings: multisine, sweep",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws iwan@drive:drive",
            "--laws = 'iwan@drive:drive': after @ allowed is an output, or two with a colon",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws auto,stop",
            "--laws = 'auto,stop': auto is allowed alone, for one element",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws auto --laws stop",
            "--laws = 'auto, stop': auto is allowed alone, for one element",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws auto@drive:drive",
            "--laws = 'auto@drive:drive': after @ allowed is an output, or two with a colon",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws auto --scatter gain",
            "--laws = 'auto': not with",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws auto --hold-out 0",
            "--validation: are none; allowed: one at least with laws='auto'",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --laws iwan@nowhere",
            "nowhere",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --scatter mass",
            "--scatter = 'mass': allowed are frequency, damping, gain",
        ),
        (
            "identify lines.h5 --model structured --modes modes.h5 --scatter gain",
            "--scatter: needs two recordings at least",
        ),
        ("identify lines.h5 --model linear --scatter gain", "--scatter: does not apply to --model linear"),
        ("identify lines.h5 --model structured --modes modes.h5 --hold-out 2", "no level has more than 2 realisations"),
        (
            "predict S.h5 --frequency-response 1 --modes modes.h5",
            "--modes: does not apply to a structured model, which answers",
        ),
        ("predict modes.h5 --frequency-response 1 --bands", "predictions are made with a nonlinear-mode, pnlss"),
        ("predict S.h5 --frequency-response 1 --force rms", "'rms' of a model driven by a force needs an exciter"),
        (
            "predict S.h5 --voltage-response 1",
            "--voltage-response: gives a voltage, and S.h5 is driven by a force; add --e",
        ),
        ("predict S.h5 --multisine lines.h5 --exciter S.h5", "--exciter: does not apply to --multisine"),
        (
            "predict S.h5 --frequency-response 1 --exciter S.h5",
            "S.h5: is a file of kind structured, expected one of kin",
        ),
        ("predict S.h5 --multisine modes.h5", "modes.h5: "),
        ("predict modes.h5 --multisine lines.h5", "predictions are made with a nonlinear-mode, pnlss, structured, "),
    ],
)
def test_mistakes_are_named_in_one_line(there, line, said):
    done = there(f"{line} -o X.h5")
    assert done.status == 1
    assert said in done.err
    assert done.err.count("\n") == 1
