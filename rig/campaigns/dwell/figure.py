"""Figure of a dwell: frequency, damping, amplitude and force over the cycles, with the limits of the plan."""

import numpy as np

from rig.campaigns.dwell.points import DwellResult, recorded_course
from rig.campaigns.evaluation.figure import heading, notes_of
from rig.campaigns.evaluation.recorded import accepted_points, points_of
from rig.drawing.axes import widen
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, engineering
from rig.recording.reader import Recording
from rig.recording.stored import StoredTable

LEAST_SPAN = 1e-3
"""Smallest part of a value that its axis spans: less would show the scatter of the means as if it were a change."""
NEAR = 0.2  # part of a limit from which on the limit is drawn: a distant limit would flatten the curve


def draw(page: Figure, recording: Recording) -> None:
    """Draw the accepted means over the cycles. Limits are dashed; means that were not accepted are marked at the bottom."""
    course, plan = recorded_course(recording), recording.configuration["plan"]
    axes = grid(page, 2, 2)
    held = "levels_m" if plan.get("levels_m") else ""
    amplitude, unit = engineering(course.amplitude_m)
    panels = (
        (axes[0, 0], course.modal_frequency_hz, "modal frequency, Hz", "frequency"),
        (axes[0, 1], 100.0 * course.damping_ratio, "modal damping ratio, %", "damping"),
        (axes[1, 0], amplitude, f"displacement amplitude, {unit}", "" if held else "amplitude"),
        (axes[1, 1], course.force_n, "fundamental force, N", "amplitude" if held else ""),
    )
    notes = notes_of(accepted_points(recording, DwellResult))
    results = [point.result for point in points_of(recording, DwellResult) if not point.accepted]
    left_out = [result.cycles for result in results if result is not None and result.cycles is not None]
    for axis, values, label, watched in panels:
        note_points(axis.plot(course.cycles, values, "o-", color=MAIN)[0], notes)
        axis.set(xlabel="cycles", ylabel=label)
        _limits(axis, values, plan, watched)
        if left_out:
            at_bottom = {"transform": axis.get_xaxis_transform(), "clip_on": False}
            axis.plot(left_out, np.full(len(left_out), 0.02), "x", color=REJECTED, label="not accepted", **at_bottom)
        if np.isfinite(values).any():
            widen(axis, LEAST_SPAN)
        if axis.get_legend_handles_labels()[0]:
            axis.legend()
    heading(page, recording)


def _limits(axis: Axes, values: np.ndarray, plan: StoredTable, watched: str) -> None:
    """Draw the alarm and abort limits on the side to which the quantity has changed."""
    if not watched or not np.isfinite(values[0]):
        return
    sign = -1.0 if np.nanmean(values) < values[0] else 1.0
    for name, table, colour in (("alarm", plan["alarm"], REJECTED), ("abort", plan["abort"], SECOND)):
        limit = table.get(watched)
        if limit is not None and np.nanmax(np.abs(values / values[0] - 1.0)) > NEAR * limit:
            axis.axhline(values[0] * (1.0 + sign * limit), color=colour, lw=0.9, ls="--", label=f"{name}.{watched}")
