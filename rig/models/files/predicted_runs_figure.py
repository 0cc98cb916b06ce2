"""Figure of simulated multisines: error of every output over the range that a run uses."""

from typing import Any

import numpy as np

from identification import Predictions
from rig.drawing.style import MARKERS, REJECTED, plain_log, say_why_empty, shade

__all__ = ["draw_runs"]


def draw_runs(area: Any, predictions: Predictions) -> None:
    """Draw one mark per realisation and output. Unbounded runs have no error; they are only counted."""
    axis = area.subplots()
    bounded = [run for run in predictions.runs if run.bounded]
    lost = len(predictions.runs) - len(bounded)
    heading = f"{lost} of {len(predictions.runs)} multisines unbounded" if lost else f"{len(bounded)} multisines"
    axis.set_title(heading)
    if not bounded:
        say_why_empty(axis, "no run stayed bounded")
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
