"""Pages: figures on their way into a file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RecordingError
from rig.figures.style import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["page_for"]


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
        engine = page.get_layout_engine()
        if engine is not None and page.axes:
            engine.execute(page)
        page.set_layout_engine(None)  # with one, all would be drawn a second time for the layout's sake
        try:
            page.savefig(file)
        except OSError as error:
            raise RecordingError(f"{file}: cannot be written: {error.strerror}") from None
