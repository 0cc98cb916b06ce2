"""Curves of a measured backbone: those of its nonlinear mode."""

from identification import Backbone, nonlinear_mode
from rig.drawing.curves import Curves, View, backbone_curves


def curves(backbone: Backbone, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude."""
    return backbone_curves([(backbone, nonlinear_mode(backbone))], view)
