"""Recordings of every kind, and pages on which their figures are drawn."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from rig.drawing.page import page_for
from rig.drawing.style import restyle
from tests.rig.report.conftest import hostile, recordings  # noqa: F401 (fixtures)

Draw = Callable[[Figure], None]


@pytest.fixture(autouse=True)
def afterwards_as_before() -> Iterator[None]:
    yield
    restyle()


@pytest.fixture
def drawn(tmp_path: Path) -> Callable[[tuple[tuple[float, float], Draw]], Figure]:
    """Draw on a page that is written, too, so that its layout is done."""

    def page_of(what: tuple[tuple[float, float], Draw]) -> Figure:
        size_in, draw = what
        with page_for(tmp_path / "figure.png", size_in) as page:
            draw(page)
        return page

    return page_of


def texts(page: Figure) -> list[str]:
    """All texts of a page that can be seen."""
    return [text.get_text() for text in page.findobj(Text) if text.get_visible() and text.get_text()]
