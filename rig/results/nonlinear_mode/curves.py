"""Curves of a nonlinear mode."""

from identification import NonlinearMode
from rig.drawing.curves import Curves, View, backbone_curves


def curves(mode: NonlinearMode, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude."""
    return backbone_curves([(None, mode)], view)
