"""Draws the curves of files over one another on a page, with their legend and title."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rig.drawing.axes import log_axis
from rig.drawing.curves import Curves, Line, Panel, Quantity, Trace, View
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid, legend_below
from rig.drawing.steady_curve import UNSTABLE, with_neighbours
from rig.drawing.style import MARKERS, REJECTED, Artist, Axes, Figure, engineering, title
from rig.figures.looks import Look, Looks

MARGIN = 0.15
"""Empty part on either side of the measured frequencies, over their span; chosen."""
MOST_LEVELS = len(MARKERS)
"""Of more levels the legend would say nothing."""


def draw_over(
    page: Figure,
    names: Sequence[str],
    found: Sequence[Curves],
    view: View,
    family: str,
    left_out: Sequence[str] = (),
) -> None:
    """Draw curves that have the same panels over one another.

    ``names`` are those of their files; ``left_out`` says in the title what could not be drawn.
    """
    panels, looks = found[0].panels, Looks(found)
    axes = grid(page, 1, len(panels))[0]
    for n, panel in enumerate(panels):
        unit = engineering(np.concatenate([_of(panel, trace.lines[n]) for curves in found for trace in curves.traces]))[
            1
        ]
        for number, curves in enumerate(found):
            for trace in curves.traces:
                look = looks.of(number, trace.level, trace.origin)
                inside = _inside(trace, curves.panels, view)
                shown = _in_units(panel, trace.lines[n], inside, view, unit)
                _line(axes[n], shown, look, trace, f"{names[number]} {trace.level}".strip())
        _axes(axes[n], panel, view, unit)
        if family == "frequency responses" and view.frequency_hz is None and not looks.dense:
            _show_measured(axes[n], found)
    _legend(page, names, found, looks)
    specimens = " and ".join(dict.fromkeys(curves.specimen for curves in found if curves.specimen))
    omitted = [f"{name}: {curves.omitted}" for name, curves in zip(names, found, strict=True) if curves.omitted]
    what = names[0] if len(names) == 1 else f"{len(names)} {family}"
    remarks = [*(f"not drawn of {text}" for text in omitted), *(f"not drawn: {text}" for text in left_out)]
    title(page, "; ".join([f"{specimens or 'specimen'}: {what}", *remarks]))


def _show_measured(axis: Axes, found: Sequence[Curves]) -> None:
    """Let the frequency axis span what was measured, with a margin, rather than all of what models say beside it."""
    measured = [
        line.x for curves in found for trace in curves.traces if trace.origin != "model" for line in trace.lines
    ]
    if measured and any(trace.origin == "model" for curves in found for trace in curves.traces):
        low, high = (float(end(np.concatenate(measured))) for end in (np.nanmin, np.nanmax))
        axis.set_xlim(low - MARGIN * (high - low), high + MARGIN * (high - low))


def frequency_of(trace: Trace, panels: Sequence[Panel]) -> np.ndarray:
    """Return the frequency of the points of a trace, float[n]: along x or, of a backbone, along y."""
    line, panel = trace.lines[0], panels[0]
    return np.asarray(line.x if panel.x.role == "frequency" else line.y)


def _of(panel: Panel, line: Line) -> np.ndarray:
    """Return the values of a line that are amplitudes, float[n]; none if the panel shows no amplitude in metres."""
    if panel.y.unit.startswith("m") and panel.y.role == "amplitude":
        return np.asarray(line.y)
    return np.asarray(line.x if panel.x.unit == "m" else [])


def _inside(trace: Trace, panels: Sequence[Panel], view: View) -> np.ndarray:
    """bool[n]: points between the frequency limits."""
    frequency = frequency_of(trace, panels)
    if view.frequency_hz is None:
        return np.ones(frequency.size, bool)
    return np.asarray((frequency >= view.frequency_hz[0]) & (frequency <= view.frequency_hz[1]))


def _in_units(panel: Panel, line: Line, inside: np.ndarray, view: View, unit: str) -> Line:
    """Return a line as it is drawn: in the units of the panel, and only where it is inside."""
    x = np.where(inside, _shown(panel.x, line.x, view, unit), np.nan)
    return line._replace(x=x, y=_shown(panel.y, line.y, view, unit))


def _line(axis: Axes, line: Line, look: Look, trace: Trace, name: str) -> None:
    known = line.half_95 is not None and bool(np.isfinite(line.half_95).any())
    folded = line.folded is not None and bool(line.folded.any())
    style = look.style()
    if trace.origin == "model":
        _model_line(axis, line, style, name)
        return
    drawn = axis.errorbar(line.x, line.y, line.half_95, **style)[0] if known else axis.plot(line.x, line.y, **style)[0]
    note_points(drawn, trace.notes, name)
    if folded:
        style |= {"ls": "", "mfc": "white", "zorder": 3}
        axis.plot(line.x[line.folded], line.y[line.folded], **style)


def _model_line(axis: Axes, line: Line, style: dict[str, Any], name: str) -> None:
    """Draw a line with a pale band of its 95 % interval; unstable parts are dotted."""
    if line.half_95 is not None and np.isfinite(line.half_95).any():
        half = np.nan_to_num(line.half_95)
        axis.fill_between(line.x, line.y - half, line.y + half, color=style["color"], alpha=0.2, lw=0)
    unstable = np.zeros(line.x.size, bool) if line.folded is None else line.folded
    for which, dashes, told in ((~unstable, style["ls"], name), (unstable, UNSTABLE, f"{name}, unstable")):
        if which.any():
            shown = np.where(with_neighbours(which), line.y, np.nan)
            note_points(axis.plot(line.x, shown, **style | {"ls": dashes})[0], (), told)


def _shown(quantity: Quantity, values: np.ndarray, view: View, unit: str) -> np.ndarray:
    """Return values as they are drawn: metres in the unit of the panel, or amplitudes in dB."""
    if quantity.role == "amplitude" and view.amplitude == "dB":
        return np.asarray(20.0 * np.log10(np.where(values > 0.0, values, np.nan)))
    return values * {"mm": 1e3, "µm": 1e6}[unit] if quantity.unit.partition("/")[0] == "m" else values


def _axes(axis: Axes, panel: Panel, view: View, unit: str) -> None:
    for name, quantity in (("x", panel.x), ("y", panel.y)):
        shown = quantity.unit
        if quantity.role == "amplitude" and view.amplitude == "dB":
            shown = f"dB re 1 {quantity.unit}"
        elif quantity.unit.partition("/")[0] == "m":
            shown = unit + quantity.unit[1:]
        axis.set(**{f"{name}label": f"{quantity.text}, {shown}"})
        if quantity.role == "amplitude" and (view.amplitude == "log" or (view.amplitude is None and panel.log)):
            log_axis(axis, "x" if name == "x" else "y")
        elif quantity.role == "amplitude" and view.amplitude != "dB" and name == "y":
            axis.set_ylim(bottom=0.0)
        if quantity.role == "frequency" and view.frequency_hz is not None:
            axis.set(**{f"{name}lim": view.frequency_hz})
    if panel.y.text.startswith("phase lag"):
        axis.axhline(90.0, color=REJECTED, lw=0.8, zorder=1)


def _legend(page: Figure, names: Sequence[str], found: Sequence[Curves], looks: Looks) -> None:
    entries = _of_files(names, found, looks) if len(found) > 1 else []
    origins = {trace.origin for curves in found for trace in curves.traces}
    measured = next((origin for origin in ("measured", "reference") if origin in origins), None)
    levels = _levels_told(found, looks)
    if 1 < len(levels) <= MOST_LEVELS or (len(found) == 1 and levels[0]):
        for level in levels if len(levels) <= MOST_LEVELS else (levels[0], levels[-1]):
            mark = looks.of(0, level, measured or "model")
            line = looks.of(0, level, "model").line if "model" in origins else mark.line
            colour = looks.of(0, level, "model").colour if len(found) == 1 else REJECTED
            entries.append(_entry(Look(colour, mark.marker, line, hollow=measured == "reference"), level))
    if "reference" in origins:
        entries.append(_entry(looks.of(0, looks.levels[0], "reference"), "measured"))
    folded = {
        trace.origin
        for curves in found
        for trace in curves.traces
        if any(line.folded is not None and line.folded.any() for line in trace.lines)
    }
    if "measured" in folded:
        text = "folds back: unstable at a constant level of the force"
        entries.append(_entry(Look(REJECTED, "o", ""), text, "white"))
    if "model" in folded:
        entries.append(_entry(Look(REJECTED, "", UNSTABLE), "unstable"))
    legend_below(page, handles=entries)


def _levels_told(found: Sequence[Curves], looks: Looks) -> list[str]:
    """Return the levels that can be told apart: behind models, dense measurements all look the same."""
    if not (looks.dense and any(looks.of_model)):
        return looks.levels
    of_models = {trace.level for curves in found for trace in curves.traces if trace.origin == "model"}
    return [level for level in looks.levels if level in of_models] or [""]


def _of_files(names: Sequence[str], found: Sequence[Curves], looks: Looks) -> list[Artist]:
    """Return the entries of files: of several levels their colour, as a marker or a line."""
    entries = []
    for number, (name, curves) in enumerate(zip(names, found, strict=True)):
        origin = curves.traces[0].origin
        look = looks.of(number, looks.levels[0], origin)
        if looks.several:
            plain = not any(looks.of_model) or origin == "model"
            look = replace(look, marker="" if plain else look.marker, line="-" if plain else look.line)
        entries.append(_entry(look, name))
    return entries


def _entry(look: Look, text: str, fill: str | None = None) -> Artist:
    from matplotlib.lines import Line2D

    style = look.style()
    del style["markersize"]
    return Line2D([], [], label=text, **style | ({"mfc": fill} if fill else {}))
