"""Run all methods on all rigs under all conditions, into a file of one line a run; what is in the file is not run again."""

import json
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from studies.methods.choice import cheapest, meets
from studies.methods.outcome import carried_out
from studies.methods.plans import METHODS, usual_knob
from studies.methods.rigs import CONDITIONS, RIGS

Row = dict[str, Any]
Cell = tuple[str, str, bool, str]
"""Rig, method, whether the force is pure, condition."""
LONGEST_PERIODS = 20000.0
"""A knob that would make a test longer than this is not tried."""


def cells(rigs: tuple[str, ...] = RIGS, conditions: tuple[str, ...] = tuple(CONDITIONS)) -> Iterator[Cell]:
    """Return everything that is compared, all rigs under one condition first."""
    for condition in conditions:
        for rig in rigs:
            for method, what in METHODS.items():
                for pure in (False, True) if what.pure else (False,):
                    yield rig, method, pure, condition


class Runs:
    """Runs by rig, method, force, condition, knob and seed, kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        self.rows: list[Row] = [json.loads(line) for line in lines]
        self._known = {self._key(row): row for row in self.rows}

    @staticmethod
    def _key(row: Row) -> tuple[Any, ...]:
        return tuple(row[name] for name in ("rig", "method", "pure", "condition", "knob", "seed"))

    @staticmethod
    def cell_of(row: Row) -> Cell:
        """Return what a run belongs to."""
        return row["rig"], row["method"], row["pure"], row["condition"]

    def run(self, cell: Cell, knob: float, seed: int) -> Row:
        """Return a run, carried out if it is not known."""
        known = self._known.get((*cell, knob, seed))
        if known is not None:
            return known
        row = carried_out(*cell, knob, seed).row()
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        self.rows.append(row)
        self._known[self._key(row)] = row
        return row

    def of(self, cell: Cell, knob: float) -> list[Row]:
        """Return the known runs of a cell with a knob."""
        return [row for row in self.rows if self._key(row)[:5] == (*cell, knob)]


def _meets_with(runs: Runs, cell: Cell, seeds: Iterable[int], knob: float) -> bool:
    """Return whether the runs of a cell with a knob meet the bounds with all seeds; the first that does not is the last."""
    return all(meets(runs.run(cell, knob, seed)) for seed in seeds)


def race(runs: Runs, seeds: int, wanted: Iterator[Cell]) -> None:
    """Run every cell with its usual knob and all seeds, then look for the cheapest knob that meets the bounds with all."""
    for cell in wanted:
        rig, method, _, condition = cell
        usual = usual_knob(method, rig)
        some = range(1 if method == "sweep" else seeds)  # what a sweep misses is hardly noise, and it takes long
        first = [runs.run(cell, usual, seed) for seed in some]
        if any(row["asked_points"] == 0 for row in first):
            continue  # the plan was refused
        if condition == "drift":  # much more time does not help
            for factor in (0.5, 2.0):
                all(meets(runs.run(cell, factor * usual, seed)) for seed in some)
            continue
        longest = max(row["periods"] for row in first)
        cheapest(usual, partial(_meets_with, runs, cell, some), LONGEST_PERIODS / longest * usual)
