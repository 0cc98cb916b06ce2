"""Curves of a frequency response matrix."""

from identification import FrequencyResponseMatrix
from rig.drawing.curves import Curves, View, transfer_curves


def curves(matrix: FrequencyResponseMatrix, view: View) -> Curves:
    """Return size and phase of the response from the force to the channel."""
    return transfer_curves({"": matrix}, view)
