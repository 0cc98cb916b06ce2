"""The command: what it writes, what it refuses in one line, and what it leaves alone."""

import json
from pathlib import Path

import pytest

from rig.campaigns.plans import load_plan
from rig.rehearsal.rehearsal import Rehearsal
from rig.results.files import load_as
from tests.rig.rehearsal.plans import SHORT_TEXT


@pytest.fixture(autouse=True)
def folder(command, tmp_path):
    """The folder of the command, with a plan."""
    (tmp_path / "plan.toml").write_text(SHORT_TEXT)
    return tmp_path


@pytest.mark.slow
def test_a_rehearsal_its_figure_its_page_and_its_comparison(command, folder):
    told = command("rehearse plan.toml --exact -n 3 -o r.h5 --figure r.png --jobs 1").succeeded()
    assert "ends well       100 %" in told.out
    assert "3 of 3 draws, 0" in told.err
    assert {path.name for path in folder.iterdir()} == {"plan.toml", "r.h5", "r.png"}
    assert "ends well       100 %" in command("show r.h5").succeeded().out
    verdict = json.loads(command("show r.h5 --json").succeeded().out)["verdict"]
    assert verdict["ends_well"]["count"] == 3
    command("plot r.h5 -o again.png").succeeded()
    command("run plan.toml --rehearsal r.h5 -o run.h5").succeeded()
    assert "rehearsed: ends well 100 %" in command("show run.h5").succeeded().out
    compared = command("rehearse r.h5 --compare run.h5 --json").succeeded()
    assert len(json.loads(compared.out)["points"]) == 2
    assert "columns: per cent" in command("rehearse r.h5 --compare run.h5").succeeded().out


@pytest.mark.slow
def test_a_twin_is_written_and_an_improved_plan_too(command):
    Path("hasty.toml").write_text(
        SHORT_TEXT.replace("record_periods = 8", "record_periods = 8\nsettle.longest_periods = 40")
    )
    command("rehearse hasty.toml --exact -n 2 -o r.h5 --improve patient.toml --jobs 1").succeeded()
    assert load_plan("patient.toml").settle.longest_periods == 120.0
    assert "ends well 0 -> 100 %" in Path("patient.toml").read_text()
    assert len(load_as(Rehearsal, Path("patient.h5")).draws) == 2
    assert any(one.taken for one in load_as(Rehearsal, Path("r.h5")).tried)
    assert "twin 1 written to t.toml" in command("rehearse plan.toml --exact --twin 1 -o t.toml").succeeded().out
    command("run plan.toml --bench t.toml -o run.h5").succeeded()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["plan.toml", "-o", "r.h5"],
            "--from: there is no measurement of the exciter and the structure of the bench magnet-beam",
        ),
        (["plan.toml", "--exact", "-o", "r.txt"], "rehearsals are written as .h5"),
        (["plan.toml", "--exact", "-o", "missing/r.h5"], "there is no folder missing"),
        (["nothing.toml", "--exact", "-o", "r.h5"], "nothing.toml"),
        (["plan.toml", "--exact", "-o", "r.h5", "--improve", "p.h5"], "plans are written as .toml"),
        (
            ["plan.toml", "--exact", "-o", "r.h5", "--improve", "r.toml"],
            "--improve = 'r.toml': its own rehearsal would be",
        ),
        (["plan.toml", "--exact", "--twin", "9", "-n", "3", "-o", "t.toml"], "--twin = 9; allowed: 1 to 3"),
        (["plan.toml", "--from", "plan.toml", "-o", "r.h5"], "plan.toml"),
        (["plan.toml", "--compare", "plan.toml"], "plan.toml"),
        (["plan.toml", "--exact", "-o", "r.h5", "--hypotheses", "plan.toml"], "plan.toml: kind"),
    ],
)
def test_what_it_refuses_is_one_line_and_leaves_no_file(command, folder, arguments, says):
    told = command("rehearse", *arguments, "--jobs", "1")
    assert told.status == 1
    assert says in told.err
    assert told.err.count("\n") == 1
    assert {path.name for path in folder.iterdir()} == {"plan.toml"}


def test_without_an_output_it_is_wrong_use(command):
    told = command("rehearse plan.toml --exact")
    assert told.status == 2
    assert "--output: missing: the file of the rehearsal, such as -o rehearsal.h5" in told.err


def test_an_existing_file_stays_without_overwrite(command):
    command("rehearse plan.toml --exact -n 1 -o r.h5 --jobs 1").succeeded()
    before = Path("r.h5").read_bytes()
    again = command("rehearse plan.toml --exact -o r.h5")
    assert again.status == 1
    assert "r.h5: exists already" in again.err
    assert Path("r.h5").read_bytes() == before
    command("rehearse plan.toml --exact -n 2 -o r.h5 --overwrite --jobs 1").succeeded()
    assert len(load_as(Rehearsal, Path("r.h5")).draws) == 2
