"""Test many models on data they were not trained on, and tabulate their errors (Scheel et al., Tables 2 and 4)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.experiments.simulators import Simulator
from identification.models.pnlss.errors import pnlss_errors
from identification.models.pnlss.many import ModelJob
from identification.models.pnlss.model import PnlssModel

SAME_LEVEL = "same level"
"""Name of the test on the realisations that a model's own training set left out."""


@dataclass(frozen=True, kw_only=True)
class ModelTest:
    """Result of one model simulated with the input of one experiment."""

    model: str
    training_set: str
    test: str
    experiment: str
    error: float
    """Relative RMS error of the output; inf for a run that diverged."""
    range_use: float
    """Largest state or input over the largest in the training data; beyond 1 the model extrapolates."""

    @property
    def bounded(self) -> bool:
        """Whether the run stayed bounded."""
        return bool(np.isfinite(self.error))


@dataclass(frozen=True, kw_only=True)
class ErrorCell:
    """Statistics of the tests of one training set at one level; mean, deviation and largest error are over the bounded runs."""

    mean: float
    standard_deviation: float
    largest: float
    models: int
    runs: int
    unbounded_runs: int
    unbounded_models: int
    range_use: float
    """Largest known value over the bounded runs; NaN if there is none."""

    @classmethod
    def of(cls, tests: Iterable[ModelTest]) -> "ErrorCell":
        """Return the statistics of some tests; NaN where there are too few."""
        rows = list(tests)
        bounded = [row for row in rows if row.bounded]
        errors = np.array([row.error for row in bounded])
        return cls(
            mean=float(errors.mean()) if errors.size else float("nan"),
            standard_deviation=float(errors.std(ddof=1)) if errors.size > 1 else float("nan"),
            largest=float(errors.max()) if errors.size else float("nan"),
            models=len({row.model for row in rows}),
            runs=len(rows),
            unbounded_runs=len(rows) - len(bounded),
            unbounded_models=len({row.model for row in rows if not row.bounded}),
            range_use=max((row.range_use for row in bounded if np.isfinite(row.range_use)), default=float("nan")),
        )

    @property
    def extrapolated(self) -> bool:
        """Whether a bounded run went beyond the range of the training data."""
        return self.range_use > 1.0

    def row(self) -> dict[str, Any]:
        """Return JSON-able numbers by name; None for numbers that are not finite."""
        return {name: value if np.isfinite(value) else None for name, value in vars(self).items()}

    def __str__(self) -> str:
        """Format mean and, in brackets, standard deviation as in the paper, with the number of unbounded runs.

        An asterisk marks a bounded run that exceeded the range of the training data.
        """
        if not self.runs:
            return "-"
        text = f"{100 * self.mean:.2f} %"
        if np.isfinite(self.standard_deviation):
            text += f" ({100 * self.standard_deviation:.2f} %)"
        if self.extrapolated:
            text += " *"
        if not self.unbounded_runs:
            return text
        counted = f"unbounded {self.unbounded_runs} of {self.runs}"
        return counted if self.unbounded_runs == self.runs else f"{counted}; {text}"


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorTable:
    """Errors by training set and test.

    Parameters
    ----------
    output
        Name of the output channel whose errors these are.
    levels
        Test levels, lowest first.
    training_sets
        Training sets in the order of the table.
    tests
        Every single test.
    failures
        Models that could not be identified: reasons by model name.
    """

    output: str
    levels: tuple[str, ...]
    training_sets: tuple[str, ...]
    tests: tuple[ModelTest, ...]
    failures: Mapping[str, str]

    @classmethod
    def of(
        cls,
        models: Mapping[str, PnlssModel | Simulator],
        jobs: Sequence[ModelJob],
        levels: Mapping[str, Sequence[Experiment]],
        *,
        output: int | str = 0,
        failures: Mapping[str, str] | None = None,
    ) -> "ErrorTable":
        """Test the models (by the names of their jobs) on every realisation of every level that was not in their training data.

        The same-level error is the error on the realisations that a model's training set left out: one, or for the mixed set
        one of each level. Other levels are tested with all their realisations, except that models of the mixed set are tested
        only with the realisation left out. ``output`` is the output channel by name or number. Raises `IdentificationError`
        if it is unknown, or if there is no level.
        """
        IdentificationError.raise_if(not levels, "none given", field="levels", allowed="one at least")
        names = [channel.name for channel in next(iter(levels.values()))[0].output_channels]
        index = names.index(output) if output in names else output
        if not isinstance(index, int) or not 0 <= index < len(names):
            raise IdentificationError(field="output", value=output, allowed=names)
        tests: list[ModelTest] = []
        for job in jobs:
            if job.name not in models:
                continue
            for test, experiments in ((SAME_LEVEL, job.left_out), *levels.items()):
                unseen = [one for one in experiments if test != job.training_set and not job.seen(one)]
                if not unseen:
                    continue
                errors = pnlss_errors(models[job.name], unseen)
                rows = zip(errors.names, errors.relative[:, index].tolist(), errors.range_use.tolist(), strict=True)
                of = {"model": job.name, "training_set": job.training_set, "test": test}
                tests += [ModelTest(**of, experiment=name, error=error, range_use=use) for name, error, use in rows]
        return cls(
            output=names[index],
            levels=tuple(levels),
            training_sets=tuple(dict.fromkeys(job.training_set for job in jobs)),
            tests=tuple(tests),
            failures=dict(failures or {}),
        )

    def cell(self, training_set: str, test: str, *, model: str | None = None) -> ErrorCell:
        """Return the statistics over all models of a training set, or of one of these models."""
        return ErrorCell.of(
            row
            for row in self.tests
            if (row.training_set, row.test) == (training_set, test) and model in (None, row.model)
        )

    @cached_property
    def selected(self) -> dict[str, str]:
        """Model with the smallest mean same-level error of each training set, among models bounded in all these tests."""
        found: dict[str, str] = {}
        for training_set in self.training_sets:
            names = dict.fromkeys(row.model for row in self.tests if row.training_set == training_set)
            cells = {name: self.cell(training_set, SAME_LEVEL, model=name) for name in names}
            bounded = {name: cell.mean for name, cell in cells.items() if cell.runs and not cell.unbounded_runs}
            if bounded:
                found[training_set] = min(bounded, key=bounded.__getitem__)
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return one dictionary per training set and test, for all models and for the selected one (named in ``model``)."""
        found = []
        for training_set in self.training_sets:
            for model in (None, self.selected.get(training_set)):
                for test in (SAME_LEVEL, *(level for level in self.levels if level != training_set)):
                    cell = self.cell(training_set, test, model=model)
                    if cell.runs and (model is not None or cell.models):
                        found.append({"training_set": training_set, "test": test, "model": model, **cell.row()})
        return found

    def text(self) -> str:
        """Format both parts of the table as in the paper: all models, and the selected models."""
        counts = {name: self.cell(name, SAME_LEVEL).models for name in self.training_sets}
        heads = [f"{name} ({count} model{'' if count == 1 else 's'})" for name, count in counts.items()]
        lines = [f"relative error of {self.output}: mean (standard deviation) over the bounded runs"]
        lines += _aligned(["trained at", *heads], self._part({}))
        chosen = [self.selected.get(name, "none bounded") for name in self.training_sets]
        lines += ["selected: the smallest same-level error among the bounded"]
        lines += _aligned(["model", *chosen], self._part(self.selected))
        tests = (SAME_LEVEL, *self.levels)
        if any(self.cell(name, test).extrapolated for name in self.training_sets for test in tests):
            lines.append("* beyond the range of the training data: extrapolated")
        return "\n".join([*lines, *(f"not identified: {name}: {why}" for name, why in self.failures.items())])

    def _part(self, models: Mapping[str, str]) -> list[list[str]]:
        rows = []
        for test in (SAME_LEVEL, *self.levels):
            row = [test]
            for name in self.training_sets:
                shown = "-" if models and name not in models else str(self.cell(name, test, model=models.get(name)))
                row.append("(same level)" if test == name else shown)
            rows.append(row)
        return rows


def _aligned(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in (heads, *rows)) for column in range(len(heads))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in (heads, *rows)]
