"""Results that draw themselves and show themselves as a table in a notebook."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FIGURES, _TABLES = "rig.figures", "rig.show"
"""Packages that draw and tabulate; imported by name on use, so that the libraries do not depend on the bench."""


class Result:
    """Base of results: `plot` draws them, and a notebook shows them as a table."""

    def plot(self, **options: Any) -> "tuple[Axes, ...]":
        """Draw the result; return the axes of the figure, from the top left to the bottom right.

        The options are those of `rig.figures.plot`.
        """
        axes: tuple[Axes, ...] = import_module(_FIGURES).plot(self, **options)
        return axes

    def _repr_html_(self) -> str | None:
        """Return the result as a table for a notebook; None, and thus the text, if it has no table."""
        html: str | None = import_module(_TABLES).as_html(self)
        return html

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        """Return the table as HTML and as text, for IPython in a terminal and for notebooks that show no HTML."""
        tables = import_module(_TABLES)
        html, text = tables.as_html(self), tables.as_text(self)
        return {} if html is None else {"text/html": html, "text/plain": text}
