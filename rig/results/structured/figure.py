"""Figure and curves of a structured model: spectra and time of measured and simulated outputs, laws of the elements, errors."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from identification import structured_mode
from rig.drawing.curves import Curves, View, backbone_curves
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, Axes, Figure
from rig.errors import RecordingError
from rig.results.simulated.figure import channels_of, draw_simulated
from rig.results.structured.model import IdentifiedStructured

if TYPE_CHECKING:
    from identification import NonlinearElement
    from identification.models import Joint


_BEYOND = 1.5
"""Drawn displacements relative to the largest of the training data."""
_POINTS = 301
"""Points of a drawn law; chosen."""


def draw_structured(page: Figure, found: IdentifiedStructured) -> None:
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


def _laws(axis: Axes, element: "NonlinearElement", number: int) -> None:
    """Draw forces and damping of an element over its displacement, and mark the range of the training data.

    Of joints it is the loop between the ends of that range. Functions of the user are not imported and therefore not drawn.
    """
    from identification.models import Damper, Joint, Spring, UserSpring

    largest = element.largest or 1.0
    to_mm = 1e3 * element.scale_m
    x = np.linspace(-_BEYOND, _BEYOND, _POINTS) * largest
    springs = [law for law in element.laws if isinstance(law, Spring) and not isinstance(law, UserSpring)]
    functions = [law.function for law in element.laws if isinstance(law, UserSpring)]
    dampers = [law for law in element.laws if isinstance(law, Damper)]
    joints = [law for law in element.laws if isinstance(law, Joint)]
    if springs:
        axis.plot(to_mm * x, sum((law.force(x) for law in springs), np.zeros_like(x)), color=MAIN, label="spring")
    if joints:
        axis.plot(*_loop(joints, largest, to_mm), color=THIRD, label="joint")
    axis.set(xlabel=f"displacement of element {number}, mm", ylabel="force, N", xlim=(to_mm * x[0], to_mm * x[-1]))
    if element.largest is not None:
        axis.axvspan(-to_mm * largest, to_mm * largest, color=REJECTED, alpha=0.15, lw=0.0, label="training data")
    axes = [axis]
    if dampers:
        axes.append(axis.twinx())
        damping = sum((law.damping(x) for law in dampers), np.zeros_like(x))
        axes[1].plot(to_mm * x, damping, color=SECOND, ls="--", label="damper")
        axes[1].set(ylabel="damping, N s/m", ylim=(0.0, None))
    handles = [one for each in axes for one in each.get_legend_handles_labels()[0]]
    if functions:
        axis.text(0.5, 0.03, f"without {', '.join(functions)}", ha="center", transform=axis.transAxes)
    axis.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2)


def _loop(joints: "list[Joint]", largest: float, to_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement (mm) and force (N) of joints over the second of two cycles."""
    from identification.models import law_force

    x = largest * np.cos(np.linspace(0.0, 2.0 * np.pi, 2 * _POINTS))
    force = sum((law_force(law, x, np.zeros_like(x)) for law in joints), np.zeros_like(x))
    return to_mm * x, force


def curves(found: IdentifiedStructured, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude; refuse code that the model names."""
    if functions := found.functions:
        raise RecordingError(f"names a function, {functions[0]}, which is not imported to draw; use structured_mode")
    return backbone_curves([(None, structured_mode(found.model if found.fit is None else found.fit))], view)
