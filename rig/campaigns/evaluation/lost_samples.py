"""Samples that were lost on their way: which rows they are, and values in their place for windows and spectra."""

import math

import numpy as np

from rig.tick.layout import SAMPLE_LOST

__all__ = ["bridged", "lost_rows", "lost_warnings", "rms_of"]


def lost_rows(rows: np.ndarray) -> np.ndarray:
    """bool[n]: rows whose inputs are NaN: lost on their way, or the whole row in a damaged journal."""
    return np.asarray(((rows["flags"] & SAMPLE_LOST) != 0) | np.isnan(rows["inputs"]).all(axis=1))


def lost_warnings(rows: np.ndarray) -> list[str]:
    """One line with the number of lost samples; nothing where none was lost."""
    lost = int(np.count_nonzero(lost_rows(rows)))
    return [f"{lost} of {rows.size} samples were lost on their way"] if lost else []


def rms_of(rows: np.ndarray) -> list[float]:
    """RMS of every channel without its mean, in its unit; lost samples take no part."""
    inputs = rows["inputs"][~lost_rows(rows)].astype(float)
    return [float(value) for value in inputs.std(axis=0)] if inputs.size else [math.nan] * rows["inputs"].shape[1]


def _turns(theta_rad: np.ndarray) -> np.ndarray:
    """Turns of the oscillator, straight over rows that a damaged journal has lost."""
    known = np.flatnonzero(np.isfinite(theta_rad))
    return np.asarray(np.interp(np.arange(theta_rad.size), known, np.unwrap(theta_rad[known]) / (2.0 * math.pi)))


def bridged(rows: np.ndarray) -> np.ndarray:
    """float64[n, n_channels]: the inputs, gaps filled with the mean of the readings one period before and after.

    The mean is taken at the same phase, with linear interpolation between samples, so that a vibration that grows or drifts
    steadily is reproduced to second order. Windows and spectra need signals without holes; the caller leaves out results near
    a gap. Without any loss the inputs are as recorded.
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
