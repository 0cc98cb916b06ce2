"""Curves of a structured model: those of its nonlinear mode."""

from identification import structured_mode
from rig.drawing.curves import Curves, View, backbone_curves
from rig.errors import RecordingError
from rig.results.structured.model import IdentifiedStructured


def curves(found: IdentifiedStructured, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude; refuse code that the model names."""
    if functions := found.functions:
        raise RecordingError(f"names a function, {functions[0]}, which is not imported to draw; use structured_mode")
    return backbone_curves([(None, structured_mode(found.model if found.fit is None else found.fit))], view)
