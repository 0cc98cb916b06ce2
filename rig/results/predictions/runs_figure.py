"""Figure of simulated multisines: error of every output over the range that a run uses, or what planned ones reach."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import Predictions, SimulatedRun
from rig.drawing.style import MARKERS, REJECTED, plain_log, say_why_empty, shade
from rig.results.predictions.table import PLANNED


def draw_runs(area: Any, predictions: Predictions) -> None:
    """Draw one mark per realisation and output. Unbounded runs have no error; they are only counted."""
    axis = area.subplots()
    recorded = [run for run in predictions.runs if run.use != PLANNED]
    planned = not recorded
    runs = list(predictions.runs) if planned else recorded
    bounded = [run for run in runs if run.bounded]
    lost = len(runs) - len(bounded)
    which = "planned multisines" if planned else "multisines"
    axis.set_title(f"{lost} of {len(runs)} {which} unbounded" if lost else f"{len(bounded)} {which}")
    if not bounded:
        say_why_empty(axis, "no run stayed bounded")
        return
    if planned:
        _reached(axis, bounded)
        return
    names = bounded[0].outputs
    use = np.array([run.range_use for run in bounded])
    known = np.isfinite(use).all()
    across = use if known else np.arange(1, len(bounded) + 1)
    for row, name in enumerate(names):
        mark, colour = MARKERS[row % len(MARKERS)], shade(row, len(names))
        axis.semilogy(across, [100.0 * run.error[row] for run in bounded], mark, color=colour, label=name)
    if known:
        axis.set_xlim(0.0, 1.05 * max(1.0, use.max()))
        axis.axvline(1.0, color=REJECTED, lw=0.9, ls="--", label="training data")
    axis.set(xlabel="range use" if known else "run", ylabel="relative error, %")
    plain_log(axis)
    axis.legend()


def _reached(axis: Any, runs: Sequence[SimulatedRun]) -> None:
    """Draw the largest value of every output over the level, one mark per realisation; where range use is above 1, open."""
    names = runs[0].outputs
    for row, name in enumerate(names):
        mark, colour = MARKERS[row % len(MARKERS)], shade(row, len(names))
        for beyond in (False, True):
            some = [run for run in runs if (run.range_use > 1.0) is beyond]
            label = f"{name}, beyond the training data" if beyond else name
            if some:
                levels, peaks = [run.level for run in some], [run.peak[row] for run in some]
                axis.semilogy(levels, peaks, mark, color=colour, mfc="none" if beyond else None, label=label)
    axis.set(xlabel="level, V RMS", ylabel="largest value, in the unit of the output")
    plain_log(axis)
    axis.legend()
