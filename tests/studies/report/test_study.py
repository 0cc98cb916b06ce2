"""Chapters of `rig report` on a folder of `rig reproduce`."""

import json

import pytest

from rig.report.report import write_report
from studies.report.paper import SAME_LEVEL, PaperError, agreement
from tests.rig.report.page import read


def row(mean, unbounded=0):
    return {"mean": mean, "unbounded_models": unbounded, "models": 5}


@pytest.mark.parametrize(
    ("found", "paper", "begins"),
    [
        (row(0.012), PaperError(0.013, 0.003), "Agrees: within one"),
        (row(0.018), PaperError(0.013, 0.003), "Agrees to 1.7"),
        (row(0.04), PaperError(0.013, 0.003), "Does not agree: it differs by 9.0"),
        (row(0.04, 2), PaperError(None, None), "As in the paper, some are unstable: 2 of 5"),
        (row(0.04), PaperError(None, None), "Other than in the paper, none"),
        (row(None, 5), PaperError(0.013, 0.003), "Other than in the paper, every"),
        (row(0.04), None, "The paper gives no number"),
    ],
)
def test_a_sentence_says_how_far_a_number_agrees_with_the_papers(found, paper, begins):
    assert agreement(found, paper).startswith(begins)


def test_a_study_stands_beside_the_papers_numbers(tmp_path):
    folder = tmp_path / "study"
    (folder / "force").mkdir(parents=True)
    (folder / "study.json").write_text(
        json.dumps({"specimen": "magnet-beam", "bench": {"name": "<b>"}, "scatter": 0.001, "seed": 3})
    )
    (folder / "force" / "models.json").write_text(
        json.dumps({"variant": "force", "iterations": 8, "levels": ["2.6 N"]})
    )
    own = {"training_set": "2.6 N", "test": "same level", "model": None, "mean": 0.0127, "standard_deviation": 0.0003}
    own |= {"largest": 0.02, "models": 5, "runs": 50, "unbounded_runs": 1, "unbounded_models": 1, "range_use": 0.9}
    times = {"training_set": "2.6 N", "models": 5, "seconds_mean": 1.25, "seconds_most": 2.0, "iterations_mean": 8.0}
    table = {"specimen": "magnet-beam", "input": "force", "beside": [], "saturating": 0, "scatter": 0.001}
    table |= {"seed": 3, "states": 2, "realisations": None, "iterations": 8, "output": "drive", "failures": {}}
    table |= {"times": [times | {"chosen_mean": 2.0}], "errors": {"chosen on validation data": [own]}}
    (folder / "force" / "table.json").write_text(json.dumps(table | {"steady": [], "sweeps": []}))
    write_report([folder], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    paper = str(SAME_LEVEL["magnet-beam"]["2.6 N"])
    sentence = "Agrees: within one standard deviation of the paper's models."
    assert ["2.6 N", "5", "unbounded 1 of 50; 1.27 % (0.03 %)", paper, sentence] in page.rows()
    command = "rig reproduce magnet-beam -o FOLDER --iterations 8 --models 5 --scatter 0.001 --seed 3"
    assert command in page.text
    assert ["bench", "<b>"] in page.rows()
