"""Marks of a study's figures, against the numbers that they stand for."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from identification import ErrorTable
from identification.models import ModelTest
from studies.reproduce.figures import _tests

ERRORS = {"low": [0.02, 0.05, 0.08], "high": [0.4], "beyond": [0.1, 0.3, np.inf, np.inf]}
"""Relative errors by test; those without a bound are infinite."""


def table(scale=1.0, training_set="low"):
    tests = tuple(
        ModelTest(
            model=f"model {k}",
            training_set=training_set,
            test=test,
            experiment="realisation 1",
            error=scale * error,
            range_use=1.0,
        )
        for test, errors in ERRORS.items()
        for k, error in enumerate(errors)
    )
    return ErrorTable(output="drive", levels=tuple(ERRORS), training_sets=(training_set,), tests=tests, failures={})


def drawn(tables):
    axis = Figure().subplots()
    return axis, _tests(axis, tables, "low", list(ERRORS))


@pytest.mark.parametrize("number", [1, 2, 3])
def test_every_test_has_its_mark_in_the_place_of_its_models_and_the_mean_across_them(number):
    """Places divide the middle 0.8 of a column evenly, in the order of the models; no mark stands in another's place."""
    tables = {f"variant {k}": table(1.0 + k) for k in range(number)}
    axis, ends = drawn(tables)
    assert ends == pytest.approx((2.0, 40.0 * number))
    lines = iter(axis.get_lines())
    for k in range(number):
        for column, errors in enumerate(ERRORS.values()):
            bounded = 100.0 * (1.0 + k) * np.array([error for error in errors if np.isfinite(error)])
            middle, half = column - 0.4 + (k + 0.5) * 0.8 / number, 0.4 / number
            marks = next(lines)
            np.testing.assert_allclose(marks.get_ydata(), bounded, rtol=1e-12)
            assert marks.get_linestyle() == "None"
            if bounded.size == 1:
                np.testing.assert_allclose(marks.get_xdata(), [middle], atol=1e-12)
                continue
            assert np.all(np.abs(marks.get_xdata() - middle) < half)
            assert np.unique(marks.get_xdata()).size == bounded.size  # beside each other
            mean = next(lines)
            assert mean.get_label() == "mean"
            np.testing.assert_allclose(mean.get_xdata(), [middle - half, middle + half], atol=1e-12)
            np.testing.assert_allclose(mean.get_ydata(), 2 * [bounded.mean()], rtol=1e-12)
    assert next(lines, None) is None


@pytest.mark.parametrize("number", [1, 2])
def test_a_single_error_is_written_beside_its_mark_and_unbounded_runs_are_counted_at_the_top(number):
    axis, _ = drawn({f"variant {k}": table(1.0 + k) for k in range(number)})
    texts = iter(axis.texts)
    for k in range(number):
        aside = (k + 0.5) * 0.8 / number - 0.4
        error, unbounded = next(texts), next(texts)
        assert (error.get_text(), unbounded.get_text()) == (f"{40 * (k + 1)} %", "2/4 unbounded")
        assert error.xy == pytest.approx((1.0 + aside, 40.0 * (k + 1)))
        assert unbounded.get_position() == pytest.approx((2.0 + aside, 0.98))
    assert next(texts, None) is None
    assert [tick.get_text() for tick in axis.get_xticklabels()] == list(ERRORS)
    assert axis.get_title() == "trained at low"
