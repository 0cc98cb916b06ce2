"""Results that draw themselves and show themselves as a table in a notebook.

What draws and tabulates them registers under the entry point group ``vibrolock.presentation``, as ``plot``, ``html`` and
``text``: functions of a result. Thus the libraries do not depend on the bench.
"""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

GROUP = "vibrolock.presentation"
"""Entry point group of what draws and tabulates results."""


class Result:
    """Base of results: `plot` draws them; `print` and a notebook show them as a table."""

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

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the table of the result, one row for each of what it consists of; SI units, as in the names of its columns.

        Raises `ImportError` without pandas, `TypeError` for a result that has no such table.
        """
        rows = getattr(self, "table", None)
        if rows is None:
            raise TypeError(f"to_pandas: a {type(self).__name__} has no table of its own; `print` shows what there is")
        try:
            import pandas
        except ImportError:
            raise ImportError("to_pandas: needs pandas; install vibrolock[tables], or use table()") from None
        return pandas.DataFrame(rows())

    def __str__(self) -> str:
        """Return the table of the result as text; its ``repr`` if it has no table."""
        text = self._shown_as("text")
        return repr(self) if text is None else text

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
