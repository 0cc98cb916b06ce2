"""Looks of the gallery's figures: those of `rig plot`."""

from typing import Any

import matplotlib

from rig.drawing.style import COLOURS, STYLE


def apply(gallery: Any, file: Any) -> None:
    """Set the style before an example runs; the arguments are Sphinx-Gallery's."""
    matplotlib.rcdefaults()
    matplotlib.rcParams.update({key: value for key, value in STYLE.items() if key != "figure.dpi"})
    matplotlib.rcParams.update({"figure.dpi": 110, "axes.prop_cycle": matplotlib.cycler(color=COLOURS)})
