"""Samples lost in transfer: find the affected rows of a recording, and fill the gaps where complete signals are needed."""

import math

import numpy as np

from rig.tick.layout import SAMPLE_LOST

__all__ = ["bridged", "lost_rows", "lost_warnings", "rms_of"]


def lost_rows(rows: np.ndarray) -> np.ndarray:
    """Return bool[n]: rows whose inputs are NaN, either lost in transfer or because the row is missing in a damaged journal."""
    return np.asarray(((rows["flags"] & SAMPLE_LOST) != 0) | np.isnan(rows["inputs"]).all(axis=1))


def lost_warnings(rows: np.ndarray) -> list[str]:
    """Return one line on the number of lost samples; an empty list if none was lost."""
    lost = int(np.count_nonzero(lost_rows(rows)))
    return [f"{lost} of {rows.size} samples were lost on their way"] if lost else []


def rms_of(rows: np.ndarray) -> list[float]:
    """RMS of every channel without its mean, in the channel's unit. Lost samples are left out."""
    inputs = rows["inputs"][~lost_rows(rows)].astype(float)
    return [float(value) for value in inputs.std(axis=0)] if inputs.size else [math.nan] * rows["inputs"].shape[1]


def _turns(theta_rad: np.ndarray) -> np.ndarray:
    """Turns of the oscillator, interpolated linearly over rows missing in a damaged journal."""
    known = np.flatnonzero(np.isfinite(theta_rad))
    return np.asarray(np.interp(np.arange(theta_rad.size), known, np.unwrap(theta_rad[known]) / (2.0 * math.pi)))


def bridged(rows: np.ndarray) -> np.ndarray:
    """Return the inputs, float64[n, n_channels], with gaps filled by the mean of the readings one period before and after.

    Both readings are taken at the same phase by linear interpolation. The error for a vibration that grows or drifts steadily
    is therefore of second order. Use this for windows and spectra, which need signals without gaps; the caller must leave out
    results within reach of a gap. Inputs without lost samples are returned as recorded.
    """
    inputs = np.asarray(rows["inputs"].astype(float))
    lost = lost_rows(rows)
    if not lost.any() or lost.all():
        return inputs
    turns = _turns(rows["theta_rad"].astype(float))
    there, at = turns[~lost], turns[lost]
    before, after = at - 1.0 >= there[0], at + 1.0 <= there[-1]
    for column in inputs.T:
        known = column[~lost]
        earlier, later = np.interp(at - 1.0, there, known), np.interp(at + 1.0, there, known)
        column[lost] = np.select(
            [before & after, before, after], [0.5 * (earlier + later), earlier, later], np.interp(at, there, known)
        )
    return inputs
