"""``rig reproduce`` as it is typed: a whole small study, taken up again, and one line for every mistake."""

import csv
import json

import pytest

from rig.models.files import load
from rig.models.pnlss import IdentifiedPnlss
from simulators.analysis import constant_force_response
from simulators.virtual_rig import VirtualRig
from tests.rig.reproduce.commands import typed

SMALL = "reproduce magnet-beam --models 1 --levels 1 --iterations 8 --without sweeps"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduced") / "study"
    done = typed(f"{SMALL} -o {folder}")
    assert done.status == 0, done.err
    folder.joinpath("printed.txt").write_text(done.out)
    return folder


@pytest.fixture(scope="module")
def results(folder):
    return json.loads((folder / "force" / "table.json").read_text())


def test_a_model_of_the_lowest_level_is_near_its_noise_at_its_own_level(results):
    (own,) = [row for row in results["errors"]["chosen on validation data"] if row["model"] is None]
    assert (own["training_set"], own["test"], own["runs"], own["unbounded_runs"]) == ("0.5 N", "same level", 1, 0)
    assert own["mean"] < 0.03
    (linear,) = [row for row in results["errors"]["linear start"] if row["model"] is None]
    assert own["mean"] < linear["mean"]


def test_steady_peaks_stand_beside_those_of_the_rig(results):
    coupled = {row["force_n"]: row for row in results["steady"] if row["held"] == "fundamental"}
    assert set(coupled) == {0.25, 0.55}
    for force_n, row in coupled.items():
        truth = constant_force_response(VirtualRig.shipped("magnet-beam"), force_n)
        assert row["truth_m"] == pytest.approx(truth.amplitude_m.max(), rel=0.01)
        assert row["range_use"] > 1.0  # what the lowest level trains is far below these forces
    sine = {row["force_n"]: row["truth_m"] for row in results["steady"] if row["held"] == "pure-sine"}
    assert 1.02 < sine[0.55] / coupled[0.55]["truth_m"] < 1.2  # the exciter's harmonics take from the peak


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


def test_what_is_in_the_folder_is_not_made_again(folder, results):
    kept = {
        path: path.stat().st_mtime_ns
        for path in folder.rglob("*.h5")  # recordings and models
    }
    again = typed(f"{SMALL.replace('--models 1', '--models 2')} --without steady -o {folder} --json")
    assert again.status == 0, again.err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    summary = json.loads(again.out)
    assert [row["models"] for row in summary["times"]] == [2]
    assert len(list((folder / "force" / "models").glob("*.h5"))) == 2


@pytest.mark.parametrize(
    ("line", "status", "said"),
    [
        ("reproduce tower -o x", 1, "specimen 'tower': allowed is magnet-beam, friction-beam"),
        ("reproduce magnet-beam -o x --models some", 1, "--models some: allowed is a number from 1, or paper"),
        ("reproduce magnet-beam -o x --scatter 1", 1, "--scatter 1: allowed is 0 to 0.05"),
        ("reproduce magnet-beam -o x --bench real.toml", 1, "which only a virtual bench tells"),
        ("reproduce magnet-beam", 2, "-o"),
    ],
)
def test_mistakes_are_one_line_and_leave_no_folder(tmp_path, monkeypatch, line, status, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "real.toml").write_text('base = "magnet-beam"\n[driver]\nname = "serial"\noptions.port = "/dev/none"\n')
    done = typed(line)
    assert done.status == status
    assert said in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "x").exists()
