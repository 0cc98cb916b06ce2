"""A report on what is no recording: models, predictions, rehearsals, imported measurements, checks, and studies."""

import contextlib
import shutil

import pytest

from rig.recording.arrays import kind_of
from rig.report.report import write_report
from rig.results.files import save
from rig.results.kinds import KINDS
from rig.show.summary import summarise
from rig.text.console import PrintedTable, collected
from tests.command import run_command
from tests.rig.exchange.conftest import matrix, modes, responses  # noqa: F401 (fixtures)
from tests.rig.exchange.structured_models import structure
from tests.rig.report.page import read
from tests.sharing import copy_of, made_once, shared_folder

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8]
record_periods = 8

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""
MADE = (
    "identify backbone.h5 -o nonlinear-mode.h5",
    "identify response-controlled.h5 --model force-surface -o force-surface.h5",
    "identify multisine.h5 --model exciter -o exciter.h5",
    "identify multisine.h5 --model pnlss --degrees 2 --rate 200 --iterations 2 -o pnlss.h5",
    "predict nonlinear-mode.h5 --frequency-response 0.2 -o predictions.h5",
    "rehearse plan.toml --exact -n 2 -o rehearsal.h5",
    "check --bench magnet-beam -o check.h5",
)


@pytest.fixture(scope="module")
def shelf(recordings, tmp_path_factory):
    """A folder of recordings and of what the commands make of them."""
    made = made_once(shared_folder() / "reported", lambda folder: _fill(folder, recordings.values()))
    return copy_of(made, tmp_path_factory.mktemp("shelf"))


def _fill(folder, recordings):
    for path in recordings:
        shutil.copy(path, folder)
    (folder / "plan.toml").write_text(PLAN)
    with contextlib.chdir(folder):
        for line in MADE:
            run_command(line).succeeded()


def check_against_show(path, report):
    """Every table and every line that `rig show` prints of a model stands in the report."""
    write_report([path], report)
    page = read(report)
    summary = summarise(path)
    with collected() as printed:
        KINDS[summary["kind"]].say(summary)
    plain = page.text.replace("±", "+-").replace("m/s²", "m/s^2").replace("kg^−½", "kg^-1/2").replace("≥ ", ">= ")
    rows = [[cell.replace("≥ ", ">= ") for cell in row] for row in page.rows()]
    assert printed
    for one in printed:
        if isinstance(one, PrintedTable):
            for row in one.rows:
                assert [" ".join(cell.split()) for cell in row] in rows
        else:
            assert " ".join(one.split()) in plain
    assert "svg" in page.seen
    assert "SHA-256" in page.text


@pytest.mark.parametrize("kind", ["nonlinear-mode", "force-surface", "exciter", "pnlss", "predictions", "rehearsal"])
def test_a_model_of_every_kind_has_what_rig_show_says_and_its_figure(kind, shelf, tmp_path):
    assert kind_of(shelf / f"{kind}.h5") == kind
    check_against_show(shelf / f"{kind}.h5", tmp_path / "report.html")


@pytest.mark.parametrize("name", ["modes", "matrix", "responses"])
def test_modes_and_imported_measurements_too(name, request, tmp_path):
    save(request.getfixturevalue(name), tmp_path / "thing.h5")
    check_against_show(tmp_path / "thing.h5", tmp_path / "report.html")


def test_a_structured_model_too(tmp_path):
    save(structure(), tmp_path / "thing.h5")
    check_against_show(tmp_path / "thing.h5", tmp_path / "report.html")


def test_a_check_has_its_verdict_and_every_test(shelf, tmp_path):
    write_report([shelf / "check.h5"], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    summary = summarise(shelf / "check.h5")
    assert f"Verdict: {summary['verdict']}." in page.text
    names = [row[:3] for row in page.rows()]
    for finding in summary["findings"]:
        assert [finding["name"], finding["channel"], finding["verdict"]] in names
