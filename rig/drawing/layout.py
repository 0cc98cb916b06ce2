"""Layout of pages: matplotlib's constrained layout, and titles at the left edge of the axes."""

from functools import cache
from typing import TYPE_CHECKING, Any

from rig.drawing.style import Figure

if TYPE_CHECKING:
    from matplotlib.layout_engine import ConstrainedLayoutEngine


def page_layout() -> "ConstrainedLayoutEngine":
    """Return a new layout engine for a page."""
    found: ConstrainedLayoutEngine = _engine()()
    return found


@cache
def _engine() -> Any:
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    class PageLayout(ConstrainedLayoutEngine):
        """Constrained layout that also aligns the title."""

        def execute(self, fig: Figure) -> Any:
            found = super().execute(fig)
            align_title(fig)
            return found

        def __reduce__(self) -> tuple[Any, ...]:
            return page_layout, (), self.__dict__  # a figure can be pickled

    return PageLayout


def align_title(page: Figure) -> None:
    """Put the left end of a page's title at the left edge of its leftmost axes, unless it would end beyond the page."""
    heading = page._suptitle  # type: ignore[attr-defined]
    edges = [axis.bbox.x0 for axis in page.axes if axis.axison and axis.get_visible()]
    if heading is None or not edges:
        return
    wide = page.bbox.width
    free = wide - heading.get_window_extent().width - 0.01 * wide
    heading.set_x(max(0.01, min(min(edges), free) / wide))
