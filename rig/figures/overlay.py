"""Curves of several files over one another, or of one file with axes of one's own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rig.drawing.axes import log_axis
from rig.drawing.curves import Curves, Panel, Quantity, Trace, View
from rig.drawing.page import grid, legend_below
from rig.drawing.style import COLOURS, MARKERS, REJECTED, Axes, Figure, engineering, rc, shade, title
from rig.errors import RecordingError
from rig.figures.curves_of_files import curves_of, family_of

DENSE = 80
"""Curves with more points are drawn without markers."""
MOST_LEVELS = len(MARKERS)
"""Of more levels the legend would say nothing."""
LINES = ("-", "--", "-.", ":")
SIZE_IN = (9.0, 4.2)
"""Width and height of the page, inches; chosen."""


@dataclass(frozen=True)
class _Look:
    """How one trace is drawn."""

    colour: Any
    marker: str
    line: str
    size: float = 1.0
    """Of its markers, over the usual size: earlier files have larger ones, which later ones do not hide."""
    hollow: bool = False
    """Whether its markers are open, so that those of other files below are seen."""


def overlay(
    sources: Sequence[Path], labels: Sequence[str] = (), view: View | None = None
) -> tuple[tuple[float, float], Callable[[Figure], None]]:
    """Return the size (inches) of the page for the curves of some files, and the function that draws them on an empty page.

    The files are recordings of one kind, or recordings and models with the same axes (`rig.figures.curves_of_files`).
    ``labels`` are names in the legend, by default those of the files. Raises `RecordingError` if a file cannot be read, the
    files do not have the same axes, the number of labels is wrong, or a file does not hold what the view asks for, and
    `IdentificationError` if no point of a file was accepted.
    """
    if labels and len(labels) != len(sources):
        raise RecordingError(f"`label`: {len(labels)} for {len(sources)} files; give one for each file, in their order")
    view = view or View()
    first = family_of(sources[0])
    for path in sources[1:]:
        if family_of(path) != first:
            raise RecordingError(
                f"{sources[0]} and {path}: {first} and {family_of(path)} have no common axes; draw them apart"
            )
    found = [curves_of(path, view) for path in sources]
    for path, curves in zip(sources, found, strict=True):
        if curves.panels != found[0].panels:
            axes = [", ".join(f"{panel.y.text} ({panel.y.unit})" for panel in one.panels) for one in (found[0], curves)]
            raise RecordingError(
                f"{sources[0]} and {path}: have no common axes: {axes[0]} and {axes[1]}; draw them apart"
            )
        _check_limits(path, curves, view)
    names = list(labels) or [path.stem for path in sources]
    if not labels and len(set(names)) < len(names):
        names = [str(path.with_suffix("")) for path in sources]
    return SIZE_IN, lambda page: _draw(page, names, found, view, first)


def _check_limits(path: Path, curves: Curves, view: View) -> None:
    """Raise `RecordingError` if nothing of a file lies between the frequency limits."""
    if view.frequency_hz is None:
        return
    frequencies = np.concatenate([_frequency(trace, curves.panels) for trace in curves.traces])
    frequencies = frequencies[np.isfinite(frequencies)]
    low, high = view.frequency_hz
    if not np.any((frequencies >= low) & (frequencies <= high)):
        least, most = frequencies.min(), frequencies.max()
        raise RecordingError(f"`frequency` {low:g}:{high:g}: {path} lies between {least:g} and {most:g} Hz")


def _frequency(trace: Trace, panels: Sequence[Panel]) -> np.ndarray:
    """Return the frequency of the points of a trace, float[n]: along x or, of a backbone, along y."""
    line, panel = trace.lines[0], panels[0]
    return np.asarray(line.x if panel.x.role == "frequency" else line.y)


def _draw(page: Figure, names: Sequence[str], found: Sequence[Curves], view: View, family: str) -> None:
    panels = found[0].panels
    axes = grid(page, 1, len(panels))[0]
    levels = list(dict.fromkeys(trace.level for curves in found for trace in curves.traces))
    dense = any(line.x.size > DENSE for curves in found for trace in curves.traces for line in trace.lines)
    for n, panel in enumerate(panels):
        metres = np.concatenate([_of(panel, trace.lines[n]) for curves in found for trace in curves.traces])
        for number, curves in enumerate(found):
            for trace in curves.traces:
                look = _look(number, levels.index(trace.level), len(found), len(levels), dense)
                _line(axes[n], panel, trace, n, look, view, engineering(metres)[1], curves.panels)
        _axes(axes[n], panel, view, engineering(metres)[1])
    _legend(page, names, levels, found, dense)
    specimens = " and ".join(dict.fromkeys(curves.specimen for curves in found if curves.specimen))
    omitted = [f"{name}: {curves.omitted}" for name, curves in zip(names, found, strict=True) if curves.omitted]
    what = names[0] if len(names) == 1 else f"{len(names)} {family}"
    title(page, f"{specimens or 'specimen'}: {what}" + "".join(f"; not drawn of {text}" for text in omitted))


def _of(panel: Panel, line: Any) -> np.ndarray:
    """Return the values of a line that are amplitudes, float[n]; none if the panel shows no amplitude in metres."""
    if panel.y.unit.startswith("m") and panel.y.role == "amplitude":
        return np.asarray(line.y)
    return np.asarray(line.x if panel.x.unit == "m" else [])


def _look(number: int, level: int, files: int, levels: int, dense: bool) -> _Look:
    """Files differ in colour, levels in their marker or, of dense curves, in their line; a single file's levels in both."""
    colour = COLOURS[number % len(COLOURS)] if files > 1 else COLOURS[0] if levels == 1 else shade(level, levels)
    kind = level if levels > 1 else number
    if dense:
        return _Look(colour, "", LINES[kind % len(LINES)] if files > 1 else "-")
    size = 1.0 + 0.6 * (files - 1 - number) / max(1, files - 1)
    return _Look(colour, MARKERS[kind] if kind < len(MARKERS) else ".", "-", size, hollow=files > 1 and number > 0)


def _line(
    axis: Axes, panel: Panel, trace: Trace, n: int, look: _Look, view: View, unit: str, panels: Sequence[Panel]
) -> None:
    line = trace.lines[n]
    inside = np.ones(line.x.size, bool)
    if view.frequency_hz is not None:
        frequency = _frequency(trace, panels)
        inside = (frequency >= view.frequency_hz[0]) & (frequency <= view.frequency_hz[1])
    x = np.where(inside, _shown(panel.x, line.x, view, unit), np.nan)
    y = _shown(panel.y, line.y, view, unit)
    style: dict[str, Any] = {"color": look.colour, "marker": look.marker, "ls": look.line}
    style["markersize"] = look.size * rc("lines.markersize")
    if look.hollow:
        style["mfc"] = "none"
    if line.half_95 is not None and np.isfinite(line.half_95).any():
        axis.errorbar(x, y, line.half_95, **style)
        return
    axis.plot(x, y, **style)
    if line.folded is not None and line.folded.any():
        style |= {"ls": "", "mfc": "white", "zorder": 3}
        axis.plot(x[line.folded], y[line.folded], **style)


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


def _legend(page: Figure, names: Sequence[str], levels: Sequence[str], found: Sequence[Curves], dense: bool) -> None:
    from matplotlib.lines import Line2D

    def entry(look: _Look, text: str, fill: str | None = None) -> Line2D:
        return Line2D(
            [],
            [],
            color=look.colour,
            marker=look.marker,
            ls=look.line,
            label=text,
            mfc=fill or ("none" if look.hollow else None),
        )

    entries = []
    if len(found) > 1:
        looks = [_look(n, 0, len(found), len(levels), dense) for n in range(len(found))]
        if len(levels) > 1:
            looks = [_Look(look.colour, "", "-") for look in looks]
        entries += [entry(look, name) for look, name in zip(looks, names, strict=True)]
    if 1 < len(levels) <= MOST_LEVELS or (len(found) == 1 and levels[0]):
        some = levels if len(levels) <= MOST_LEVELS else (levels[0], levels[-1])
        for level in some:
            look = _look(0, levels.index(level), len(found), len(levels), dense)
            entries.append(entry(look if len(found) == 1 else _Look(REJECTED, look.marker, look.line), level))
    lines = [line for curves in found for trace in curves.traces for line in trace.lines]
    if any(line.folded is not None and line.folded.any() for line in lines):
        entries.append(
            entry(_Look(REJECTED, "o", ""), "folds back: unstable at a constant level of the force", "white")
        )
    legend_below(page, handles=entries)
