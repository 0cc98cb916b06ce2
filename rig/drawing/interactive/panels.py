"""The panels of a figure as numbers and texts that a page in a browser draws."""

import base64
import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from rig.drawing.interactive.shapes import NoShapeError, colour_of, looks_of, numbers, shapes_of
from rig.drawing.style import Axes, Figure

PICTURE_DPI = 150
"""Of panels that are no lines, points and areas: they are pictures."""
_RAISED = str.maketrans("0123456789-/", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ᐟ")


def contents_of(page: Figure) -> dict[str, Any]:
    """Return title, panels, legend and number of columns of a figure that was laid out. Panels are JSON-able."""
    groups = _together(page)
    panels = [_panel(page, axes) for axes in groups]
    below = page.get_supxlabel()
    return {
        "title": " ".join(page.get_suptitle().split()),
        "below": " ".join(below.split()),
        "panels": panels,
        "columns": _columns(groups),
        "legend": [entry for legend in _legends_of_areas(page) for entry in _legend(page, legend)],
    }


def _together(page: Figure) -> list[list[Axes]]:
    """Return the axes of each panel: those that lie over one another (`twinx`) are one."""
    groups: list[list[Axes]] = []
    for axis in page.axes:
        if not axis.get_visible() or not (axis.axison or axis.has_data() or axis.texts):
            continue
        twin = next((group for group in groups if np.allclose(group[0].bbox.bounds, axis.bbox.bounds, atol=1.0)), None)
        if twin is None:
            groups.append([axis])
        elif axis.axison:
            twin.append(axis)
    return [group for group in groups if group[0].axison or group[0].has_data()]


def _columns(groups: list[list[Axes]]) -> int:
    """Return how many panels stand beside one another at most."""
    tops = [round(group[0].bbox.y1 / 8.0) for group in groups]
    return max((tops.count(top) for top in tops), default=1)


def _panel(page: Figure, axes: list[Axes]) -> dict[str, Any]:
    first = axes[0]
    heading = " ".join(filter(None, (first.get_title(loc=place) for place in ("left", "center", "right"))))
    panel: dict[str, Any] = {"title": _plain(heading), "ratio": round(first.bbox.height / first.bbox.width, 3)}
    try:
        panel |= {
            "x": _axis(first, "x"),
            "y": [_axis(axis, "y") for axis in axes[:2]],
            "shapes": [shape | {"on": n} for n, axis in enumerate(axes[:2]) for shape in shapes_of(axis)],
            "texts": [found for axis in axes for found in _texts(axis)],
            "group": _group(first),
        }
    except NoShapeError:
        panel |= {"picture": _picture(page, axes), "alt": _plain(f"{first.get_ylabel()} over {first.get_xlabel()}")}
    panel["legend"] = [entry for axis in axes if (one := axis.get_legend()) for entry in _legend(page, one)]
    return panel


def _axis(axis: Axes, name: str) -> dict[str, Any]:
    """Return label, limits and scale of an axis, and its ticks if these have names."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    ticks = getattr(axis, f"{name}axis")
    scale = ticks.get_scale()
    if scale not in ("linear", "log"):
        raise NoShapeError
    label = ticks.label.get_text() or _label_of_siblings(axis, name)
    found: dict[str, Any] = {"label": _plain(label), "limits": numbers(getattr(axis, f"get_{name}lim")())}
    found["log"] = scale == "log"
    if isinstance(ticks.get_major_locator(), FixedLocator):
        places = ticks.get_major_locator()()
        named = isinstance(ticks.get_major_formatter(), FixedFormatter)
        texts = [text.get_text() for text in ticks.get_ticklabels()] if named else []
        found["ticks"] = {"at": numbers(places), "texts": texts if len(texts) == len(places) else None}
    return found


def _label_of_siblings(axis: Axes, name: str) -> str:
    """Return the label of axes that share this one, where only the outermost are labelled."""
    shared = getattr(axis, f"get_shared_{name}_axes")().get_siblings(axis)
    return next((text for one in shared if (text := getattr(one, f"get_{name}label")())), "")


def _group(axis: Axes) -> int | None:
    """Return a number that panels with the same x axis share; None for one alone."""
    shared = axis.get_shared_x_axes().get_siblings(axis)
    return min(axis.figure.axes.index(one) for one in shared) if len(shared) > 1 else None


def _texts(axis: Axes) -> Iterator[dict[str, Any]]:
    for text in axis.texts:
        x, y = text.get_position()
        in_data = text.get_transform().contains_branch_seperately(axis.transData)
        if text.get_text() and text.get_visible():
            yield {
                **{"x": float(x), "y": float(y), "inX": bool(in_data[0]), "inY": bool(in_data[1])},
                **{
                    "text": _plain(text.get_text()),
                    "across": text.get_horizontalalignment(),
                    "up": text.get_verticalalignment(),
                },
                "colour": colour_of(text.get_color()),
            }


def _legends_of_areas(page: Any) -> Iterator[Any]:
    yield from page.legends
    for area in page.subfigs:
        yield from _legends_of_areas(area)


def _legend(page: Figure, legend: Any) -> Iterator[dict[str, Any]]:
    """Yield the entries of a legend: looks and text; one without looks is its heading."""
    from matplotlib.lines import Line2D

    if heading := legend.get_title().get_text():
        yield {"text": _plain(heading)}
    known: dict[str, Any] = {}
    for axis in page.axes:
        handles, labels = axis.get_legend_handles_labels()
        known = dict(zip(labels, handles, strict=True)) | known
    for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
        label = text.get_text()
        own = handle if isinstance(handle, Line2D) or label not in known else known[label]
        yield {"text": _plain(label), "looks": looks_of(own)}


def _picture(page: Figure, axes: list[Axes]) -> str:
    """Return a panel as an address that holds its picture."""
    from matplotlib.transforms import Bbox

    boxes = [box for axis in axes if (box := axis.get_tightbbox()) is not None]
    inches = Bbox.union(boxes).transformed(page.dpi_scale_trans.inverted()).padded(0.05)
    file = io.BytesIO()
    page.savefig(file, format="png", dpi=PICTURE_DPI, bbox_inches=inches)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _plain(text: str) -> str:
    """Return a text in one line, with raised parts of formulas as characters."""
    before, *parts = text.split("$^{")
    for part in parts:
        raised, end, after = part.partition("}$")
        before += raised.translate(_RAISED) + after if end else "$^{" + part
    return " ".join(before.split())
