"""Figure of simulated multisines: error of every output over the range that a run uses."""

from typing import Any

import numpy as np

from identification import Predictions
from rig.drawing.style import REJECTED, plain_log, say_why_empty

__all__ = ["draw_runs"]

_MARKS = "os^Dv"


def draw_runs(area: Any, predictions: Predictions) -> None:
    """Draw one mark per realisation and output. Unbounded runs have no error; they are only counted."""
    from matplotlib import colormaps

    axis = area.subplots()
    bounded = [run for run in predictions.runs if run.bounded]
    lost = len(predictions.runs) - len(bounded)
    heading = f"{lost} of {len(predictions.runs)} multisines unbounded" if lost else f"{len(bounded)} multisines"
    axis.set_title(heading, fontsize=8, loc="left")
    if not bounded:
        say_why_empty(axis, "no run stayed bounded")
        return
    names = bounded[0].outputs
    use = np.array([run.range_use for run in bounded])
    known = np.isfinite(use).all()
    across = use if known else np.arange(1, len(bounded) + 1)
    for row, name in enumerate(names):
        colour = colormaps["viridis"](0.85 * row / max(1, len(names) - 1))
        mark = _MARKS[row % len(_MARKS)]
        axis.semilogy(across, [100.0 * run.error[row] for run in bounded], mark, ms=4, color=colour, label=name)
    if known:
        axis.axvline(1.0, color=REJECTED, lw=0.8, ls="--", label="training data")
    axis.set(xlabel="range use" if known else "run", ylabel="relative error, %")
    plain_log(axis)
    axis.legend(fontsize=7)
