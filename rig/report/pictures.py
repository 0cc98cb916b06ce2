"""Figures of a report: those of `rig plot`, drawn into the page."""

from collections.abc import Callable
from itertools import count
from pathlib import Path

from identification import IdentificationError
from rig.drawing.page import svg_of
from rig.drawing.style import Figure
from rig.errors import RigError
from rig.figures.files import drawing
from rig.report.document import Block, Picture, Text

_LARGEST_WIDTH_IN = 10.0
"""Wider figures of `rig plot` are drawn so wide, at the same shape: their text stays readable on A4."""


class Pictures:
    """Draws the figures of one report; each has its own number, which begins the ids inside it."""

    def __init__(self) -> None:
        self._numbers = count(1)

    def of_file(self, path: Path, caption: str, *, lateness: bool = False) -> Block:
        """Return the figure of a file, or why there is none: a recording without an accepted point has nothing to draw."""
        size_in, draw = drawing(path, lateness=lateness)
        return self.drawn(draw, size_in, caption)

    def drawn(self, draw: Callable[[Figure], None], size_in: tuple[float, float], caption: str) -> Block:
        """Return what a function draws on a page of a size (inches), or why it cannot be drawn."""
        scale = min(1.0, _LARGEST_WIDTH_IN / size_in[0])
        number = next(self._numbers)
        try:
            svg = svg_of(draw, (scale * size_in[0], scale * size_in[1]), f"figure{number}")
        except (RigError, IdentificationError) as error:
            return Text(f"There is no figure: {error}", "note")
        return Picture(f"Figure {number}. {caption}", svg)
