"""Results that draw themselves and show themselves as a table in a notebook.

What draws and tabulates them registers under the entry point group ``vibrolock.presentation``, as ``plot``, ``html`` and
``text``: functions of a result. Thus the libraries do not depend on the bench.
"""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GROUP = "vibrolock.presentation"
"""Entry point group of what draws and tabulates results."""


class Result:
    """Base of results: `plot` draws them, and a notebook shows them as a table."""

    def plot(self, **options: object) -> "tuple[Axes, ...]":
        """Draw the result; return the axes of the figure, from the top left to the bottom right.

        The options are those of `rig.figures.plot`. Raises `ImportError` if nothing that draws results is installed.
        """
        draw = _registered("plot")
        if draw is None:
            raise ImportError(
                f"plot: nothing that draws a {type(self).__name__} is installed; install vibrolock with rig"
            )
        axes: tuple[Axes, ...] = draw(self, **options)
        return axes

    def _repr_html_(self) -> str | None:
        """Return the result as a table for a notebook; None, and thus the text, if it has no table."""
        return self._shown_as("html")

    def _repr_mimebundle_(self, **_: object) -> dict[str, str]:
        """Return the table as HTML and as text, for IPython in a terminal and for notebooks that show no HTML."""
        html, text = self._shown_as("html"), self._shown_as("text")
        return {} if html is None or text is None else {"text/html": html, "text/plain": text}

    def _shown_as(self, form: str) -> str | None:
        show = _registered(form)
        shown: str | None = None if show is None else show(self)
        return shown


def _registered(name: str) -> Callable[..., Any] | None:
    """Return a registered function; None if there is none, or what registered it has been removed."""
    for entry in entry_points(group=GROUP, name=name):
        try:
            found: Callable[..., Any] = entry.load()
        except ModuleNotFoundError:
            continue
        return found
    return None
