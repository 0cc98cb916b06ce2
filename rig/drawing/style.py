"""Style shared by all figures: colours, fonts, grid, sizes of pages, and resolution of traces. `restyle` changes it.

The colours are those of Okabe and Ito (*Color universal design*, 2008; recommended by B. Wong, Nature Methods 8, 441, 2011):
readers with any of the common colour vision deficiencies can tell them apart. Font sizes come from the style alone: a drawing
function passes no ``fontsize``, so that `restyle` reaches all text. Curves that belong to an ordered quantity, such
as a level, take their colour from viridis without its yellow end (`shade`).
"""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.errors import RecordingError

if TYPE_CHECKING:
    from matplotlib.artist import Artist as Artist
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure, SubFigure as SubFigure
    from matplotlib.typing import ColorType as ColorType
else:  # matplotlib is loaded when something is drawn
    Artist = Axes = Figure = SubFigure = ColorType = Any

MAIN, SECOND, THIRD = "#0072b2", "#d55e00", "#009e73"
REJECTED = "#767676"
"""Grey of everything that is not accepted, and of reference lines: still readable as text on white (contrast 4.5 to 1)."""
COLOURS = (MAIN, SECOND, THIRD, "#e69f00", "#cc79a7", "#56b4e9", "#000000")
"""Colours of things beside one another that have no order, such as recordings."""
MARKERS = "os^Dv<>P"
"""Markers of things beside one another: with a marker of its own, each can also be told apart in black and white."""

_LETTER = 0.56
"""Mean width of a letter over the size of its font (DejaVu Sans)."""
_LABELS = 5.0
"""Usual width of what stands left of the axes, their label and the numbers of ticks, over the size of the font."""
TRACE_BINS = 1200  # parts of a drawn trace of samples; chosen
_MM_PER_IN = 25.4  # mm in an inch, by definition


@dataclass(frozen=True)
class Preset:
    """One look for one purpose: a size of the page, and what differs from the common style."""

    width_mm: float | None = None
    """Width of the page; None: that of each figure."""
    height_mm: float | None = None
    """Height of the page; None: what the panels need."""
    rc: Mapping[str, object] = field(default_factory=dict)
    """Settings of matplotlib."""


def _sizes(
    text: float, small: float, title: float, axes: float, line: float, marker: float, grid: float, dpi: float
) -> dict[str, object]:
    """Return settings of matplotlib for sizes of text, lines and markers, points, and dots per inch."""
    return {
        **dict.fromkeys(("font.size", "axes.titlesize", "figure.labelsize"), text),
        **dict.fromkeys(("legend.fontsize", "xtick.labelsize", "ytick.labelsize"), small),
        "figure.titlesize": title,
        "axes.linewidth": axes,
        "lines.linewidth": line,
        "lines.markersize": marker,
        "grid.linewidth": grid,
        "figure.dpi": dpi,
    }


PRESETS = {
    "screen": Preset(),
    "paper": Preset(85.0, None, {**_sizes(7.5, 6.5, 7.5, 0.6, 0.9, 2.8, 0.4, 600), "legend.handlelength": 1.6}),
    "slide": Preset(338.667, 190.5, _sizes(15.0, 13.0, 18.0, 1.1, 2.0, 6.5, 0.9, 144)),
}
"""The looks by name: ``screen`` (each figure at its own size), ``paper`` (one column, 85 mm), ``slide`` (16:9, 1920 x 1080)."""

_COMMON: dict[str, object] = {
    "font.size": 9,
    "legend.fontsize": 8,
    "axes.titlesize": 9,
    "figure.titlesize": 11,
    "figure.labelsize": 9,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.edgecolor": "#404040",
    "axes.formatter.useoffset": False,
    "grid.color": "#e2e2e2",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
    "errorbar.capsize": 2.0,
    "legend.frameon": False,
    "figure.dpi": 150,
    "pdf.fonttype": 42,  # text stays text, in fonts that editors understand
    "svg.fonttype": "none",
}
STYLE: dict[Any, Any] = dict(_COMMON)
"""Settings of matplotlib with which figures are drawn. Only `restyle` changes them."""
_page_mm: list[float | None] = [None, None]


def restyle(
    preset: str | Path = "screen",
    rc: Mapping[str, object] | None = None,
    *,
    size_mm: tuple[float, float | None] | None = None,
) -> None:
    """Draw all further figures of this process in another style. ``restyle()`` goes back to the first one.

    Parameters
    ----------
    preset
        ``"screen"``, ``"paper"``, ``"slide"``, or a style sheet of matplotlib (``*.mplstyle``), which is laid over the first.
    rc
        Settings of matplotlib that are laid over the preset, such as ``{"font.family": "serif"}``.
    size_mm
        Width and height of the page, mm, instead of the preset's; height None: what the panels need.

    Raises
    ------
    RecordingError
        If there is no such preset, no such setting or no such style sheet, or if a size is not positive.
    """
    import matplotlib as mpl

    found = PRESETS.get(str(preset), Preset())
    sheet: Any = {}
    try:
        if str(preset) not in PRESETS:
            if Path(preset).suffix != ".mplstyle":
                raise RecordingError(
                    f"`style` {preset}: is none of {', '.join(PRESETS)} and no style sheet (.mplstyle)"
                )
            sheet = mpl.rc_params_from_file(preset, use_default_template=False)
        wanted = {**_COMMON, **found.rc, **sheet, **(rc or {})}
        mpl.RcParams(wanted)
    except OSError as error:
        raise RecordingError(f"{preset}: cannot be read: {error.strerror}") from None
    except (KeyError, ValueError) as error:
        raise RecordingError(f"`style` {preset}: {str(error).strip(chr(34)).splitlines()[0]}") from None
    size = (found.width_mm, found.height_mm) if size_mm is None else size_mm
    if any(side is not None and not 10.0 <= side <= 2000.0 for side in size):
        sides = " x ".join(f"{side:g}" for side in size if side is not None)
        raise RecordingError(f"`size` {sides} mm: each side of a page is 10 to 2000 mm long")
    STYLE.clear()
    STYLE.update(wanted)
    _page_mm[:] = size


def page_in(size_in: tuple[float, float]) -> tuple[float, float]:
    """Return width and height (inches) of the page for a figure that has a size of its own (inches)."""
    width, height = (None if side is None else side / _MM_PER_IN for side in _page_mm)
    if width is None:
        return size_in
    return width, width * size_in[1] / size_in[0] if height is None else height


def height_is_free() -> bool:
    """Return whether a figure may make its page as tall as its panels need."""
    return _page_mm[0] is not None and _page_mm[1] is None


def rc(name: str) -> Any:
    """Return a setting of matplotlib with which the figure at hand is drawn, such as ``lines.linewidth``."""
    import matplotlib as mpl

    settings: Any = mpl.rcParams
    return settings[name]


def shade(index: int, count: int) -> tuple[float, float, float, float]:
    """Return the colour of one of ``count`` things in an order, such as levels: from dark to light."""
    from matplotlib import colormaps

    red, green, blue, alpha = colormaps["viridis"](0.85 * index / max(1, count - 1))
    return red, green, blue, alpha


def engineering(amplitude_m: np.ndarray) -> tuple[np.ndarray, str]:
    """Convert amplitudes to millimetres or micrometres, whichever reads better; also return the unit."""
    factor, unit = length_factor(amplitude_m)
    return factor * amplitude_m, unit


def length_factor(amplitude_m: np.ndarray) -> tuple[float, str]:
    """Return factor and name of the unit, millimetres or micrometres, in which amplitudes read better."""
    return (1e6, "µm") if amplitude_m.size and np.nanmax(amplitude_m) < 5e-4 else (1e3, "mm")


def legend_above(axis: Axes, columns: int, heading: str | None = None) -> None:
    """Put the legend above the panel, where it hides nothing."""
    axis.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        title=heading,
        handlelength=1.2,
        borderaxespad=0.2,
        alignment="left",
    )


def say_why_empty(axis: Axes, text: str) -> None:
    """Write into a panel why it is empty."""
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color=REJECTED, parse_math=False)
    axis.set(xticks=[], yticks=[])


def title(page: Figure, text: str) -> None:
    """Write a title at the top left, in as many lines as it needs, unless the text is empty.

    The layout of a page puts it at the left edge of the axes (`rig.drawing.layout`).
    """
    if text:
        beside_axes = _LABELS * points("font.size") / 72.0  # inches
        shown = lines_on(page, text, "figure.titlesize", page.get_figwidth() - beside_axes)
        page.suptitle(shown, x=0.01, ha="left", parse_math=False)


def lines_on(page: Figure, text: str, setting: str, width_in: float | None = None) -> str:
    """Return a text in lines as long as a page is wide, for the font size of a setting such as ``figure.titlesize``.

    Matplotlib's own wrapping would read ``$`` as the beginning of a formula. ``width_in``: inches, in place of the page's.
    """
    width_in = page.get_figwidth() if width_in is None else width_in
    return textwrap.fill(text, max(20, int(0.98 * 72.0 * width_in / (_LETTER * points(setting)))))


def points(setting: str) -> float:
    """Return a font size of the style, points, by the name of its setting."""
    from matplotlib.font_manager import FontProperties

    return float(FontProperties(size=rc(setting)).get_size_in_points())


def unit_text(unit: str) -> str:
    """Return a unit as written at an axis."""
    written = {"m/s2": "m/s²", "m/s^2": "m/s²"}
    if unit in written:
        return written[unit]
    over, slash, under = unit.rpartition("/")
    return f"({written[over]})/{under}" if slash and over in written else unit


def plain_log(axis: Axes) -> None:
    """Label a logarithmic axis of errors with plain numbers, with some intermediate ones if it spans little."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    low, high = axis.get_ylim()
    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    if high < 30.0 * low:
        axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0, 7.0)))
        axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    else:
        axis.yaxis.set_minor_formatter("")
