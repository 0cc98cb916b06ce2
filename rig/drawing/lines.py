"""Values at the lines of a spectrum, made fit for drawing."""

import numpy as np

from vibrolock.arrays import Float


def pooled(errors: Float, lines: int = 21) -> Float:
    """Return the root mean square of standard errors over neighbouring lines; their scatter means nothing."""
    window = np.ones(min(lines, errors.size))
    power = np.convolve(errors**2, window, mode="same") / np.convolve(np.ones(errors.size), window, mode="same")
    return np.asarray(np.sqrt(power))


def without_wraps(angle_deg: Float) -> Float:
    """Return an angle with NaN where it wraps from 180 to -180 deg, so that no vertical line is drawn there."""
    jump = np.abs(np.diff(angle_deg, prepend=angle_deg[:1])) > 180.0
    return np.where(jump, np.nan, angle_deg)
