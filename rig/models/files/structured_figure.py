"""Figure of a structured model: spectra and time of measured and simulated outputs, laws of the elements, errors."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rig.drawing.style import MAIN, REJECTED, SECOND
from rig.models.files.simulated_figure import channels_of, draw_simulated

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification import NonlinearElement
    from rig.models.files.structured import IdentifiedStructured

__all__ = ["draw_structured"]

_BEYOND = 1.5
"""Drawn displacements relative to the largest of the training data."""
_POINTS = 301


def draw_structured(page: "Figure", found: "IdentifiedStructured") -> None:
    """Draw the drive point's spectrum and a stretch of time, measured and simulated, the elements, and all errors."""
    model = found.model
    modes, elements = len(model.frequency_hz), len(model.elements)
    heading = (
        f"structured model of {model.specimen or 'an unnamed specimen'}: {channels_of(model)}, "
        f"{modes} mode{'s' * (modes > 1)}, {elements} element{'s' * (elements != 1)}, {model.sample_rate_hz:g} Hz"
    )
    panels = {
        f"element {number}": partial(_laws, element=element, number=number)
        for number, element in enumerate(model.elements, 1)
    }
    draw_simulated(page, found, heading, panels)


def _laws(axis: "Axes", element: "NonlinearElement", number: int) -> None:
    """Draw force and damping of an element over its displacement, and mark the range of the training data."""
    largest = element.largest or 1.0
    x = np.linspace(-_BEYOND, _BEYOND, _POINTS) * largest
    z_mm = 1e3 * element.scale_m * x
    force = sum((a * x ** (k + 2) for k, a in enumerate(element.spring_n)), np.zeros(_POINTS))
    damping = sum((g * np.abs(x) ** (j + 1) for j, g in enumerate(element.damper_n_s_m)), np.zeros(_POINTS))
    axis.plot(z_mm, force, color=MAIN, label="spring")
    axis.set(xlabel=f"displacement of element {number}, mm", ylabel="force, N", xlim=(z_mm[0], z_mm[-1]))
    if element.largest is not None:
        edge = 1e3 * element.scale_m * largest
        axis.axvspan(-edge, edge, color=REJECTED, alpha=0.15, lw=0.0, label="training data")
    beside = axis.twinx()
    beside.plot(z_mm, damping, color=SECOND, ls="--", label="damper")
    beside.set(ylabel="damping, N s/m", ylim=(0.0, None))
    handles = [one for each in (axis, beside) for one in each.get_legend_handles_labels()[0]]
    axis.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
