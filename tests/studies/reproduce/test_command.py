"""``rig reproduce`` as it is typed: a whole small study, taken up again, and one line for every mistake."""

import csv
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from rig.bench import load_bench
from rig.results.files import load
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.pnlss.views import draw_pnlss
from simulators import VirtualRig
from simulators.analysis import constant_force_response
from studies.reproduce.options import Options
from studies.reproduce.specimens import SPECIMENS
from studies.reproduce.steady import steady
from studies.reproduce.sweeps import COUPLED, simulated_sweeps
from tests.command import run_command
from tests.sharing import copy_of, made_once, shared_folder

SMALL = "reproduce magnet-beam --models 1 --levels 1 --iterations 8 --without sweeps"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = made_once(shared_folder() / "reproduced", _reproduce) / "study"
    return copy_of(made, tmp_path_factory.mktemp("reproduced") / "study")


def _reproduce(folder):
    folder /= "study"
    done = run_command(f"{SMALL} -o {folder}").succeeded()
    folder.joinpath("printed.txt").write_text(done.out)


@pytest.fixture(scope="module")
def results(folder):
    return json.loads((folder / "force" / "table.json").read_text())


@pytest.mark.slow
def test_a_model_of_the_lowest_level_is_near_its_noise_at_its_own_level(results):
    (own,) = [row for row in results["errors"]["chosen on validation data"] if row["model"] is None]
    assert (own["training_set"], own["test"], own["runs"], own["unbounded_runs"]) == ("0.5 N", "same level", 1, 0)
    assert own["mean"] < 0.03
    (linear,) = [row for row in results["errors"]["linear start"] if row["model"] is None]
    assert own["mean"] < linear["mean"]


def study_of(folder, **changes):
    """Options of the study in the folder with other forces and sweeps, and its model."""
    specimen = replace(SPECIMENS["magnet-beam"], **changes)
    options = Options(specimen=specimen, bench=load_bench("magnet-beam"), folder=folder, levels=1)
    (path,) = (folder / "force" / "models").glob("*01.h5")
    return options, {"0.5 N": (path.stem, load(path).model)}


@pytest.mark.slow
def test_steady_peaks_within_the_range_are_those_of_the_rig(folder):
    options, models = study_of(folder, forces_n=(0.05,))
    truth = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.05)
    for row in (one.row() for one in steady(options, models, print)[0]):
        assert row["complete"]
        assert row["peak_m"] == pytest.approx(truth.amplitude_m.max(), rel=0.02)
        assert row["peak_hz"] == pytest.approx(truth.frequency_hz[np.argmax(truth.amplitude_m)], rel=1e-3)


def test_what_is_cut_off_far_beyond_the_range_is_no_peak(folder, results):
    for row in results["steady"]:  # what the lowest level trains is far below these forces
        assert (row["complete"], row["error"]) == (False, None)
        assert row["peak_m"] < row["truth_m"]
        assert any(note.startswith("the response from 22 Hz ends at") for note in row["notes"])
    lines = [line for line in (folder / "printed.txt").read_text().splitlines() if "fundamental" in line]
    assert len(lines) == 2
    for line in lines:
        assert line.split()[6] == ">="
        assert line.split()[8:10] == ["-", "-"]


def test_sweeps_of_force_models_are_simulated_from_the_voltage_too(folder):
    options, models = study_of(folder, sweeps=("sweep-3",))
    alone, coupled = simulated_sweeps(options, models, print)
    assert (alone.given, coupled.given) == ("force", COUPLED)
    assert np.array_equal(alone.measured, coupled.measured)
    assert abs(coupled.row()["peak_error"]) < 0.05
    assert coupled.rms_error < 0.5 * alone.rms_error


def test_models_know_which_realisations_they_were_identified_with_whatever_the_file_is_called(
    command, folder, tmp_path
):
    (path,) = (folder / "force" / "models").glob("*01.h5")
    other = tmp_path / "other-name.h5"
    other.write_bytes((folder / "recordings" / "multisine-1.h5").read_bytes())
    done = command(f"predict {path} --multisine {other} -o {tmp_path / 'P.h5'} --json")
    uses = [run["use"] for run in json.loads(done.out)["multisines"]]
    assert uses == ["test", "validation", "training", "training", "training"]


@pytest.mark.slow
def test_figures_of_a_small_study_say_what_is_missing_and_why_curves_end(command, folder, monkeypatch):
    pages = {}

    def keep(study, name, draw, size):
        pages[name] = Figure(figsize=size, layout="constrained")
        draw(pages[name], study)

    monkeypatch.setattr("studies.reproduce.figures._write", keep)
    assert command(f"{SMALL} -o {folder}").status == 0
    errors, steady_page = pages["errors"], pages["steady"]
    assert "tests of 1 model; 2 of 3 levels not recorded" in errors.get_suptitle().replace("\n", " ")
    (axis,) = errors.axes
    drawn = [line for line in axis.get_lines() if np.size(line.get_xdata()) == 1]
    table = json.loads((folder / "force" / "table.json").read_text())["errors"]
    wanted = {name: 100.0 * row["mean"] for name, (row, *_) in table.items()}
    assert {line.get_label(): pytest.approx(line.get_ydata()[0]) for line in drawn} == wanted
    assert len(wanted) == 4
    (legend,) = steady_page.legends
    texts = [text.get_text().replace("\n", " ") for text in legend.get_texts()]
    assert "the curve ends" in texts
    said = steady_page.get_suptitle().replace("\n", " ")
    assert said.endswith("a curve ends, because the states are beyond 3 times those of the training data")
    assert len(texts) == len(set(texts))
    for axis in steady_page.axes:
        assert [line for line in axis.get_lines() if line.get_marker() == "s" and np.size(line.get_xdata()) == 2]


def test_models_of_a_study_are_drawn_with_spectrum_and_time(folder):
    (path,) = (folder / "force" / "models").glob("*01.h5")
    found = load(path)
    page = Figure(figsize=(12.0, 7.5), layout="constrained")
    draw_pnlss(page, found)
    assert [axis.get_xlabel() for axis in page.axes if axis.axison] == ["frequency, Hz", "time, s", "iteration"]
    assert np.median(found.spectra.noise) < np.median(found.spectra.error)


@pytest.mark.parametrize(
    ("option", "kind"),
    [("--input voltage", "voltage"), ("--beside backbone-fine", "force-backbone-fine"), ("--states 1", "force-n1")],
)
def test_other_kinds_of_models_have_a_folder_beside(command, folder, option, kind):
    done = command(f"{SMALL.replace('8', '6')} --without steady {option} -o {folder} --json")
    assert done.status == 0, done.err
    (path,) = (folder / kind / "models").glob("*.h5")
    model = load(path).model
    told = json.loads(done.out)
    (own,) = [row for row in told["errors"]["chosen on validation data"] if row["model"] is None]
    assert own["unbounded_runs"] == 0
    if kind == "voltage":
        assert [channel.name for channel in (*model.inputs, *model.outputs)][:2] == ["voltage", "force"]
        assert len(model.output_features.exponents) == 0
        assert own["mean"] < 0.03
    elif kind == "force-backbone-fine":
        assert any("backbone" in name for name in model.training)
        (lines,) = (folder / "force" / "models").glob("*01.h5")
        assert model.state_range.max() > 3.0 * load(lines).model.state_range.max()
    else:
        assert model.states == 1


def test_tables_models_and_figures_are_in_the_folder(folder, results):
    (path,) = (folder / "force" / "models").glob("*.h5")
    model = load(path)
    assert isinstance(model, IdentifiedPnlss)
    assert model.model.nonlinear_coefficients == 64
    with (folder / "force" / "errors.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["variant"] for row in rows} == set(results["errors"])
    for name in ("errors.png", "steady.png"):
        assert (folder / "force" / name).read_bytes().startswith(b"\x89PNG")
    text = (folder / "printed.txt").read_text()
    assert "same level  " in text
    assert "0.5 N (1 model)" in text


def test_what_is_in_the_folder_is_not_made_again(command, folder, tmp_path):
    folder = shutil.copytree(folder, tmp_path / "study")  # the others count on what is in theirs
    kept = {
        path: path.stat().st_mtime_ns
        for path in folder.rglob("*.h5")  # recordings and models
    }
    again = command(f"{SMALL.replace('--models 1', '--models 2')} --without steady -o {folder} --json")
    assert again.status == 0, again.err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    summary = json.loads(again.out)
    assert [row["models"] for row in summary["times"]] == [2]
    assert len(list((folder / "force" / "models").glob("*.h5"))) == 2


@pytest.mark.parametrize(
    ("line", "status", "said"),
    [
        (
            "reproduce tower -o x",
            1,
            "specimen 'tower': allowed is magnet-beam, friction-beam, silverbox",
        ),
        ("reproduce magnet-beam -o x --models some", 1, "--models some: allowed is a number from 1, or paper"),
        ("reproduce magnet-beam -o x --scatter 1", 1, "--scatter 1: allowed is 0 to 0.05"),
        ("reproduce magnet-beam -o x --bench real.toml", 1, "which only a virtual bench tells"),
        ("reproduce magnet-beam", 2, "-o"),
    ],
)
def test_mistakes_are_one_line_and_leave_no_folder(command, tmp_path, line, status, said):
    (tmp_path / "real.toml").write_text('base = "magnet-beam"\n[driver]\nname = "serial"\noptions.port = "/dev/none"\n')
    done = command(line)
    assert done.status == status
    assert said in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_structured_models_stand_beside_the_others_in_the_same_folder(command, folder):
    line = "reproduce magnet-beam --models 1 --levels 1 --without sweeps --realisations 1 --model structured"
    done = command(f"{line} -o {folder}")
    assert done.status == 0, done.err
    found = json.loads((folder / "structured-r1" / "table.json").read_text())
    (own,) = [row for row in found["errors"]["fitted"] if row["model"] is None]
    assert (own["unbounded_runs"], found["model"]) == (0, "structured")
    assert own["mean"] < 0.005
    assert "all kinds of models in this folder" in done.out
    (again,) = [line for line in command(f"{line} -o {folder}").err.splitlines() if "model " in line] or [""]
    assert again == ""  # the model is not fitted twice
    specimen = replace(SPECIMENS["magnet-beam"], sweeps=("sweep-1",))
    options = Options(specimen=specimen, bench=load_bench("magnet-beam"), folder=folder, levels=1, model="structured")
    (path,) = (folder / "structured-r1" / "models").glob("*01.h5")
    alone, coupled = simulated_sweeps(options, {"0.5 N": (path.stem, load(path).model)}, print)
    assert (alone.given, coupled.given) == ("force", COUPLED)
    assert abs(coupled.row()["peak_error"]) < 0.02
    assert coupled.row()["range_use"] < 1.0
    assert coupled.rms_error < 0.05


@pytest.mark.slow
def test_runs_that_differ_have_shifts_of_their_own(command, tmp_path):
    line = "reproduce magnet-beam --models 1 --levels 1 --without sweeps --without steady --model structured"
    done = command(f"{line} --scatter 0.001 --shifts -o {tmp_path / 'study'}")
    assert done.status == 0, done.err
    found = json.loads((tmp_path / "study" / "structured-shifts" / "table.json").read_text())
    own, middle = (
        next(row["mean"] for row in found["errors"][variant] if row["model"] is None)
        for variant in ("with each run's own shifts", "fitted")
    )
    assert own < 0.005 < middle
    (frequency,) = [row for row in found["shifts"] if row["effect"] == "frequency 1"]
    assert frequency["width_low"] < 0.001 < frequency["width_high"]
    assert "frequencies shift by" in done.err


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--model spline", "--model spline: allowed is pnlss, structured"),
        ("--model structured --states 2", "--states 2: is of PNLSS models; leave it out"),
        ("--shifts", "--shifts: is for runs that differ; add --scatter, or leave it out"),
        ("--model structured --input voltage", "--input voltage: is of PNLSS models; leave it out"),
    ],
)
def test_what_is_not_of_structured_models_is_refused(command, tmp_path, option, message):
    done = command(f"reproduce magnet-beam {option} -o {tmp_path / 'study'}")
    assert (done.status, message in done.err) == (1, True), done.err
