"""Figures of what is in files and of results in memory, as matplotlib axes.

Begin with `plot`: it draws a file, a run, a recording, or a result of identification or analysis::

    import rig
    from rig import figures

    figures.plot(rig.run("magnet-beam/backbone"))
    figures.plot("model.h5")
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from rig.drawing.curves import View as View
    from rig.drawing.style import restyle as restyle
    from rig.figures.results import plot as plot
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
