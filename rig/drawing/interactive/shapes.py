"""Lines, points, error bars and areas of matplotlib's axes as numbers that a page in a browser draws."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from rig.drawing.style import Artist, Axes, ColorType
from vibrolock.arrays import Float

Shape = dict[str, Any]
"""One thing to draw: its ``kind`` (``line``, ``bars`` or ``area``), coordinates, and looks in pixels of a page (96 an inch)."""
PIXELS = 96.0 / 72.0
"""Of a page, in a point."""
DIGITS = 7
"""Significant digits of coordinates."""
MOST = 4000
"""Largest number of points of a line; of more, the least and the greatest of neighbours remain."""
_CAPS = ("|", "_")


class NoShapeError(Exception):
    """Something in the axes is neither line nor point nor area."""


def note_points(line: Artist, notes: tuple[str, ...], name: str = "") -> None:
    """Say of each point of a line what a reader in a browser is told there, such as the quality of the measurement.

    ``name`` is told of a line that has no name in a legend.
    """
    line.vibrolock_notes, line.vibrolock_name = notes, name  # type: ignore[attr-defined]


def shapes_of(axis: Axes) -> list[Shape]:
    """Return what is drawn in axes, from the back to the front; raise `NoShapeError` where it is no lines, points and areas."""
    halves = {id(line): half for line, half in _halves(axis)}
    artists = sorted([*axis.collections, *axis.patches, *axis.lines], key=lambda artist: artist.get_zorder())
    if axis.images or axis.name != "rectilinear":
        raise NoShapeError
    return [shape for artist in artists if artist.get_visible() for shape in _shapes(axis, artist, halves)]


def looks_of(artist: Any) -> Shape:
    """Return the looks of an artist in a legend."""
    from matplotlib.container import Container
    from matplotlib.lines import Line2D

    if isinstance(artist, Container):
        artist = artist[0]
    if isinstance(artist, Line2D):
        return _looks_of_line(artist)
    face = artist.get_facecolor()
    return {"kind": "area", "colour": colour_of(face if np.ndim(face) < 2 else face[0])}


def colour_of(colour: ColorType, alpha: float | None = None) -> str:
    """Return a colour as ``#rrggbbaa``."""
    from matplotlib.colors import to_hex, to_rgba

    return to_hex(to_rgba(colour, alpha), keep_alpha=True)


def numbers(values: Any) -> list[float | None]:
    """Return numbers with `DIGITS` significant digits; None in place of what is not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, float)]


def thinned(x: Float, y: Float) -> tuple[Float, Float]:
    """Return a line with `MOST` points at most: of neighbours the one with the least and the one with the greatest ``y``."""
    if x.size <= MOST:
        return x, y
    ends = np.linspace(0, x.size, MOST // 2 + 1).astype(int)
    kept = []
    for first, end in pairwise(ends):
        some = y[first:end]
        if np.isfinite(some).all():
            kept += [first + int(np.argmin(some)), first + int(np.argmax(some))]
        else:  # a gap stays one
            kept += [first, first + int(np.flatnonzero(~np.isfinite(some))[0])]
    at = np.unique(kept)
    return x[at], y[at]


def _halves(axis: Axes) -> Iterator[tuple[Artist, Float]]:
    """Yield lines with error bars along y, and half of the bar of each point."""
    from matplotlib.container import ErrorbarContainer

    container: Any
    for container in axis.containers:
        if isinstance(container, ErrorbarContainer) and container.has_yerr and container[0] is not None:
            segments = container[2][-1].get_segments()
            half = np.array([0.5 * np.ptp(one[:, 1]) if len(one) == 2 else np.nan for one in segments])
            if half.size == np.size(container[0].get_xdata()):
                yield container[0], half


def _shapes(axis: Axes, artist: Any, halves: Mapping[int, Float]) -> Iterator[Shape]:
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    in_data = artist.get_transform().contains_branch_seperately(axis.transData)
    along = {"inX": bool(in_data[0]), "inY": bool(in_data[1])}
    if isinstance(artist, Line2D):
        yield {**_line(artist, halves.get(id(artist))), **along}
    elif isinstance(artist, LineCollection):
        yield {**_bars(artist), **along}
    elif isinstance(artist, PolyCollection):
        yield {**_areas(artist), **along}
    elif isinstance(artist, Patch):
        rings = artist.get_path().transformed(artist.get_patch_transform()).to_polygons(closed_only=False)
        in_data = artist.get_data_transform().contains_branch_seperately(axis.transData)
        along = {"inX": bool(in_data[0]), "inY": bool(in_data[1])}
        yield {"kind": "area", "colour": colour_of(artist.get_facecolor()), **along, "rings": _rings(rings)}
    else:
        raise NoShapeError


def _bars(artist: Any) -> Shape:
    ends = np.array([one for one in artist.get_segments() if len(one) == 2]).reshape(-1, 4)
    looks = {"colour": colour_of(artist.get_color()[0]), "width": PIXELS * float(artist.get_linewidth()[0])}
    return {"kind": "bars", **looks, "ends": [numbers(end) for end in ends.T]}


def _areas(artist: Any) -> Shape:
    rings = [path.vertices for path in artist.get_paths() if len(path.vertices)]
    return {"kind": "area", "colour": colour_of(artist.get_facecolor()[0]), "rings": _rings(rings)}


def _rings(rings: Any) -> list[list[list[float | None]]]:
    return [[numbers(ring[:, 0]), numbers(ring[:, 1])] for ring in rings]


def _line(line: Any, half: Float | None) -> Shape:
    from matplotlib.cbook import STEP_LOOKUP_MAP

    x, y = (np.asarray(values, float) for values in (line.get_xdata(orig=False), line.get_ydata(orig=False)))
    if line.get_drawstyle() != "default":
        x, y = STEP_LOOKUP_MAP[line.get_drawstyle()](x, y)
    x, y = thinned(x, y)
    notes = getattr(line, "vibrolock_notes", ())
    found = {"kind": "line", **_looks_of_line(line), "x": numbers(x), "y": numbers(y)}
    if half is not None:
        found["half"] = numbers(half)
    if len(notes) == x.size:
        found["notes"] = list(notes)
    return found


def _looks_of_line(line: Any) -> Shape:
    """Return colour, line and marker; lines without dashes have no ``dash``, those without line no ``width``."""
    marker, drawn = line.get_marker(), line.get_linestyle() not in ("None", "none", " ", "")
    colour = colour_of(line.get_color(), line.get_alpha())
    looks: Shape = {"kind": "line", "colour": colour}
    if drawn:
        looks["width"] = PIXELS * float(line.get_linewidth())
        dashes = line._unscaled_dash_pattern[1]  # what get_linestyle calls "--" whatever it is
        if dashes:
            looks["dash"] = [float(one) * looks["width"] for one in dashes]
    if marker not in ("", " ", "None", "none", None):
        face = line.get_markerfacecolor()
        looks |= {"marker": str(marker), "size": PIXELS * float(line.get_markersize())}
        looks["fill"] = "none" if str(face) in ("none", "white") else colour_of(face, line.get_alpha())
        looks["edge"] = colour_of(line.get_markeredgecolor(), line.get_alpha())
    label = str(line.get_label())
    if name := getattr(line, "vibrolock_name", "") or ("" if label.startswith("_") else label):
        looks["name"] = name
    looks["silent"] = marker in _CAPS
    return looks
