"""Pages: figures on their way into a file or into a document."""

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rig.drawing.style import STYLE
from rig.errors import RecordingError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["page_for", "svg_of"]


@contextmanager
def page_for(file: Path, size_in: tuple[float, float]) -> Iterator["Figure"]:
    """Give an empty page of a size (inches), and write what has been drawn on it into a file (png, pdf or svg, by its suffix).

    Raises `RecordingError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        page = Figure(figsize=size_in, layout="constrained")
        yield page
        _lay_out(page)
        try:
            page.savefig(file)
        except OSError as error:
            raise RecordingError(f"{file}: cannot be written: {error.strerror}") from None


def svg_of(draw: Callable[["Figure"], None], size_in: tuple[float, float], name: str) -> str:
    """Return what ``draw`` draws on an empty page of a size (inches) as an ``<svg>`` element for an HTML document.

    ``name`` (letters and digits) begins every id in it and must differ from those of the document's other figures. Nothing in
    the element refers to anything outside of it.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    text = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name, "svg.fonttype": "path"}):
        page = Figure(figsize=size_in, layout="constrained")
        draw(page)
        _lay_out(page)
        page.savefig(text, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    svg = text.getvalue()
    svg = re.sub(r"<!--.*?-->", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    return re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{name}-", svg)


def _lay_out(page: "Figure") -> None:
    """Lay out the page once; with a layout engine, savefig would draw all of it a second time."""
    engine = page.get_layout_engine()
    if engine is not None and page.axes:
        engine.execute(page)
    page.set_layout_engine(None)
