"""Pages: figures on their way into a file or into a document."""

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from rig.drawing.interactive.document import MARK, document
from rig.drawing.layout import page_layout
from rig.drawing.style import STYLE, Artist, Axes, Figure, height_is_free, lines_on, page_in, points
from rig.errors import RecordingError

NARROW_IN = 5.0
"""On narrower pages panels stand below one another."""
_WIDE = 1.6
"""On pages whose width is more than this times their height, three rows of two panels become two rows of three."""
_PANEL_IN, _TITLE_IN, _MOST_IN = 1.6, 0.3, 8.9
"""Heights on a narrow page: of a panel, of the title, and of the column of a journal, which is the most."""


_MARKS = {
    ".png": ({"Software": "vibrolock"}, b"Software\0vibrolock"),
    ".pdf": ({"Creator": "vibrolock"}, b"/Creator (vibrolock)"),
    ".svg": ({"Creator": "vibrolock"}, b"<dc:title>vibrolock</dc:title>"),
}
"""By the suffix of a picture: what it says of who made it, and how that stands in its file."""
_HTML = ".html"
COLLAPSED = "constrained_layout not applied"
"""Beginning of what matplotlib warns of where axes have no room."""


def check_ending(figure: Path) -> None:
    """Raise `RecordingError` unless ``figure`` ends as figures do."""
    if figure.suffix.lower() not in (*_MARKS, _HTML):
        raise RecordingError(f"{figure}: figures are written as .png, .pdf, .svg or .html")


def check_replaceable(figure: Path) -> None:
    """Raise `RecordingError` for a file that exists and is not a figure of this program."""
    suffix = figure.suffix.lower()
    mark = MARK.encode() if suffix == _HTML else _MARKS[suffix][1]
    try:
        ours = not figure.is_file() or mark in figure.read_bytes()
    except OSError as error:
        raise RecordingError(f"{figure}: cannot be written: {error.strerror}") from None
    if not ours:
        raise RecordingError(
            f"{figure}: exists already and is not a figure of this program; choose another name, or --overwrite"
        )


@contextmanager
def page_for(file: Path, size_in: tuple[float, float]) -> Iterator[Figure]:
    """Give an empty page, and write what has been drawn on it into a file (png, pdf, svg or html, by its suffix).

    ``size_in`` is the size of this figure (inches); `rig.drawing.style.restyle` can ask for another page.
    Raises `RecordingError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        page = Figure(figsize=page_in(size_in), layout=page_layout())
        yield page
        _lay_out(page)
        try:
            if file.suffix.lower() == _HTML:
                file.write_text(document(page), encoding="utf-8", newline="\n")
            else:
                page.savefig(file, metadata=_MARKS[file.suffix.lower()][0])
        except OSError as error:
            raise RecordingError(f"{file}: cannot be written: {error.strerror}") from None


def svg_of(draw: Callable[[Figure], None], size_in: tuple[float, float], name: str) -> str:
    """Return what ``draw`` draws on an empty page of a size (inches) as an ``<svg>`` element for an HTML document.

    ``name`` (letters and digits) begins every id in it and must differ from those of the document's other figures. Nothing in
    the element refers to anything outside of it.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    text = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name, "svg.fonttype": "path"}):
        page = Figure(figsize=size_in, layout=page_layout())
        draw(page)
        _lay_out(page)
        page.savefig(text, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    svg = text.getvalue()
    svg = re.sub(r"<!--.*?-->", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    return re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{name}-", svg)


def grid(
    page: Figure,
    rows: int,
    columns: int = 1,
    *,
    sharex: bool | Literal["none", "all", "row", "col"] = False,
    height_ratios: Sequence[float] | None = None,
    down_columns: bool = False,
) -> np.ndarray:
    """Give panels in rows and columns, object[rows, columns] of axes, arranged as the page allows.

    On a page as narrow as a paper's column the panels stand below one another, row by row or (``down_columns``) column by
    column, and where its height is free the page becomes as tall as they need. On a wide page, such as a slide, more rows than
    columns change places with them. A panel is therefore best labelled by itself; where ``sharex``, label every panel and call
    its ``label_outer()``.
    """
    width, height = page.get_figwidth(), page.get_figheight()
    if width < NARROW_IN:
        count = rows * columns
        ratios = [ratio for ratio in height_ratios or [1.0] * rows for _ in range(columns)]
        if height_is_free():
            page.set_figheight(min(_PANEL_IN * sum(ratios) / min(ratios) + _TITLE_IN, _MOST_IN))
        axes = page.subplots(count, 1, sharex=sharex, squeeze=False, height_ratios=ratios)
        return np.asarray(axes).reshape(rows, columns, order="F" if down_columns else "C")
    if rows > columns > 1 and width > _WIDE * height and height_ratios is None:
        return np.asarray(page.subplots(columns, rows, sharex=sharex, squeeze=False)).T
    return np.asarray(page.subplots(rows, columns, sharex=sharex, squeeze=False, height_ratios=height_ratios))


def legend_below(page: Figure, *panels: Axes, handles: Sequence[Artist] = ()) -> None:
    """Write one legend below all panels, in as many columns as the page has room for.

    It names each thing that the ``panels`` label once, or the ``handles``. Names are not read as formulas.
    """
    found = [*handles, *(handle for panel in panels for handle in panel.get_legend_handles_labels()[0])]
    entries = {str(handle.get_label()): handle for handle in reversed(found)}
    names = list(dict.fromkeys(str(handle.get_label()) for handle in found))
    if not names:
        return
    columns = columns_for(names, page.get_figwidth())
    legend = page.legend(handles=[entries[name] for name in names], loc="outside lower left", ncols=columns)
    for text in legend.get_texts():
        text.set_parse_math(False)
    _grow(page, 1.6 * points("legend.fontsize") / 72.0 * -(-len(names) // columns))


def text_below(page: Figure, text: str) -> None:
    """Write a text below all panels, in as many lines as it needs."""
    shown = lines_on(page, text, "figure.labelsize")
    page.supxlabel(shown, x=0.01, ha="left", parse_math=False)
    _grow(page, 1.4 * points("figure.labelsize") / 72.0 * (1 + shown.count("\n")))


def _grow(page: Figure, by_in: float) -> None:
    """Make room on a narrow page whose height is free."""
    if height_is_free() and page.get_figwidth() < NARROW_IN:
        page.set_figheight(page.get_figheight() + by_in)


def columns_for(names: Sequence[str], width_in: float) -> int:
    """Return how many entries of a legend fit beside one another into a width (inches)."""
    entry_in = points("legend.fontsize") * (0.55 * max(map(len, names)) + 5.0) / 72.0
    return min(len(names), max(1, int(width_in / entry_in)))


def _lay_out(page: Figure) -> None:
    """Lay out the page once; with a layout engine, savefig would draw all of it a second time.

    Labels that are longer than their axes are broken into two lines, and ticks whose numbers touch are thinned out; this takes
    a second time. Raises `RecordingError` if the page has no room for the axes.
    """
    from matplotlib.axes import Axes

    engine = page.get_layout_engine()
    if engine is not None and page.axes:
        axes = page.findobj(Axes)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", COLLAPSED)
            engine.execute(page)
            changed = _break_labels(axes) | _thin_ticks(axes, page.dpi)
            warnings.filterwarnings("error", COLLAPSED)
            try:
                if changed or min(min(axis.get_position().size) for axis in page.axes) <= 0.0:
                    engine.execute(page)
            except UserWarning:
                width, height = (25.4 * side for side in page.get_size_inches())
                raise RecordingError(
                    f"`size` {width:.0f} x {height:.0f} mm: has no room for this figure; take a larger one, or the style paper"
                ) from None
    page.set_layout_engine(None)


def _break_labels(axes: Sequence[Axes]) -> bool:
    """Break vertical labels that are longer than their axes into two lines; return whether there were any."""
    broken = False
    for axis in axes:
        label = axis.yaxis.label
        words = label.get_text().split()
        if len(words) < 2 or "\n" in label.get_text() or label.get_window_extent().height <= axis.bbox.height:
            continue
        lines = [(" ".join(words[:n]), " ".join(words[n:])) for n in range(1, len(words))]
        label.set_text("\n".join(min(lines, key=lambda pair: max(map(len, pair)))))
        broken = True
    return broken


def _thin_ticks(axes: Sequence[Axes], dpi: float) -> bool:
    """Take fewer ticks where their numbers along x touch; return whether there were any."""
    from matplotlib.ticker import MaxNLocator

    thinned = False
    for axis in axes:
        locator = axis.xaxis.get_major_locator()
        low, high = sorted(axis.get_xlim())
        shown = [
            label.get_window_extent()
            for label in axis.get_xticklabels()
            if label.get_text() and label.get_visible() and low <= label.get_position()[0] <= high
        ]
        gap = 0.5 * points("xtick.labelsize") / 72.0 * dpi
        if isinstance(locator, MaxNLocator) and any(b.x0 - a.x1 < gap for a, b in pairwise(shown)):
            locator.set_params(nbins=max(2, len(shown) // 2))
            thinned = True
    return thinned
