"""Values at the lines of a spectrum, made fit for drawing, and poles of stabilisation diagrams."""

import numpy as np

from identification import StabilisationDiagram
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes
from vibrolock.arrays import Float


def draw_poles(axis: Axes, diagram: StabilisationDiagram, in_frequency: str, in_all: str) -> None:
    """Draw physical poles over the model order; the names are those of poles stable in frequency alone, and in all."""
    for which, marker, colour, label in (
        (~diagram.frequency_stable, ".", REJECTED, "new"),
        (diagram.frequency_stable & ~diagram.stable, "+", SECOND, in_frequency),
        (diagram.stable, "o", MAIN, in_all),
    ):
        at = which & diagram.physical
        axis.plot(diagram.frequency_hz[at], diagram.order[at], marker, mfc="none", color=colour, label=label)


def pooled(errors: Float, lines: int = 21) -> Float:
    """Return the root mean square of standard errors over neighbouring lines; their scatter means nothing."""
    window = np.ones(min(lines, errors.size))
    power = np.convolve(errors**2, window, mode="same") / np.convolve(np.ones(errors.size), window, mode="same")
    return np.asarray(np.sqrt(power))


def without_wraps(angle_deg: Float) -> Float:
    """Return an angle with NaN where it wraps from 180 to -180 deg, so that no vertical line is drawn there."""
    jump = np.abs(np.diff(angle_deg, prepend=angle_deg[:1])) > 180.0
    return np.where(jump, np.nan, angle_deg)
