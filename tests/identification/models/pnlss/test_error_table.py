"""The table of errors against errors worked out by hand, and against a system that blows up for a known reason."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identification import ErrorTable, IdentificationError, realisation_combinations
from identification.models.pnlss.error_table import SAME_LEVEL, ErrorCell, ModelTest
from tests.identification.models.pnlss.studies import realisations, system
from tests.refused import refused


@pytest.fixture(scope="module")
def study():
    levels = {"low": realisations(0.2, 3), "high": realisations(12.0, 3)}
    jobs = realisation_combinations(levels, models=2)
    return levels, jobs


def test_the_true_system_has_no_error_anywhere(study):
    levels, jobs = study
    table = ErrorTable.of({job.name: system() for job in jobs}, jobs, levels)
    assert table.cell("low", "high").runs == 2 * 3
    assert table.cell("mixed", "high").runs == 2  # what is left out, and nothing else
    assert table.cell("mixed", SAME_LEVEL).runs == 2 * 2
    assert table.cell("low", "low").runs == 0  # that is the same level
    assert all(row.error == 0.0 for row in table.tests)


def test_errors_are_relative_rms_over_what_counts(study):
    levels, jobs = study
    wrong = system(0.0)
    table = ErrorTable.of({jobs[0].name: wrong}, jobs, levels, output="drive")
    by_hand = []
    for one in levels["high"]:
        y = np.zeros(400)
        for k in range(399):
            y[k + 1] = 0.9 * y[k] + 0.1 * one.inputs[0, k]
        by_hand.append(np.sqrt(np.mean((y - one.outputs[0])[100:] ** 2) / np.mean(one.outputs[0, 100:] ** 2)))
    cell = table.cell("low", "high")
    assert cell.mean == pytest.approx(np.mean(by_hand), rel=1e-9)
    assert cell.standard_deviation == pytest.approx(np.std(by_hand, ddof=1), rel=1e-9)


def test_a_model_of_the_wrong_sign_is_unbounded_at_the_high_level_and_counted(study):
    levels, jobs = study
    models = {job.name: system(0.02 if job.name.endswith("01") else -0.0199) for job in jobs}
    table = ErrorTable.of(models, jobs, levels, failures={"low 09": "too few samples"})
    cell = table.cell("low", "high")
    assert (cell.models, cell.runs, cell.unbounded_models, cell.unbounded_runs) == (2, 6, 1, 3)
    assert cell.mean == table.cell("low", "high", model="low 02").mean
    assert 0.0 < cell.mean < 0.05
    assert table.cell("high", SAME_LEVEL).unbounded_runs == 1
    assert table.selected["high"] == "high 02"
    text = table.text()
    assert "unbounded 3 of 6; " in text
    assert "not identified: low 09: too few samples" in text


def test_where_no_model_is_bounded_none_is_selected(study):
    levels, jobs = study
    table = ErrorTable.of({job.name: system(0.02) for job in jobs}, jobs, levels)
    assert set(table.selected) == {"low"}
    assert "none bounded" in table.text()
    assert np.isnan(table.cell("high", SAME_LEVEL).mean)
    assert str(table.cell("high", SAME_LEVEL)) == "unbounded 2 of 2"


def test_rows_hold_every_cell_of_all_models_and_of_the_selected(study):
    levels, jobs = study
    table = ErrorTable.of({job.name: system(-0.019) for job in jobs}, jobs, levels)
    rows = table.rows()
    json.dumps(rows)
    assert [(row["training_set"], row["test"]) for row in rows if row["model"] is None] == [
        ("low", SAME_LEVEL),
        ("low", "high"),
        ("high", SAME_LEVEL),
        ("high", "low"),
        ("mixed", SAME_LEVEL),
        ("mixed", "low"),
        ("mixed", "high"),
    ]
    assert {row["model"] for row in rows if row["model"]} == set(table.selected.values())


def test_cells_read_like_the_papers():
    rows = [
        ModelTest(model="a", training_set="low", test="high", experiment=str(k), error=e, range_use=1.0)
        for k, e in enumerate((0.04, 0.06))
    ]
    assert str(ErrorCell.of(rows)) == "5.00 % (1.41 %)"
    assert str(ErrorCell.of([])) == "-"


def test_cells_of_runs_beyond_the_trained_range_are_marked(study):
    levels, jobs = study
    table = ErrorTable.of({job.name: system() for job in jobs}, jobs, levels)  # trained up to 1 N
    assert str(table.cell("low", "high")).endswith(" *")
    assert "* beyond the range of the training data: extrapolated" in table.text().splitlines()
    inside = ErrorTable.of(
        {job.name: replace(system(), state_range=np.array([1e3]), input_range=np.array([1e3])) for job in jobs},
        jobs,
        levels,
    )
    assert "*" not in inside.text()


def test_rows_have_no_number_where_there_is_none():
    one = {"model": "a", "training_set": "low", "test": "high"}
    uses = (float("nan"), 0.7, float("nan"))
    rows = [ModelTest(**one, experiment=str(k), error=0.1, range_use=use) for k, use in enumerate(uses)]
    assert ErrorCell.of(rows).range_use == 0.7
    row = ErrorCell.of([ModelTest(**one, experiment="1", error=float("inf"), range_use=float("inf"))]).row()
    assert (row["mean"], row["standard_deviation"], row["largest"], row["range_use"]) == (None,) * 4
    assert (row["runs"], row["unbounded_runs"]) == (1, 1)


def test_data_read_twice_is_still_no_test_of_a_model_that_was_trained_on_it():
    once, again = ({"low": realisations(0.2, 3), "high": realisations(12.0, 3)} for _ in range(2))
    jobs = realisation_combinations(once, models=1)
    tables = [ErrorTable.of({job.name: system() for job in jobs}, jobs, levels) for levels in (once, again)]
    assert [table.cell("mixed", "high").runs for table in tables] == [1, 1]


def test_an_output_that_is_not_there_is_named(study):
    levels, jobs = study
    with refused(IdentificationError, field="output", value="tip", allowed="drive"):
        ErrorTable.of({}, jobs, levels, output="tip")
