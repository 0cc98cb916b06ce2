"""Samples lost in transfer: find the affected rows of a recording, and fill the gaps where complete signals are needed."""

import math

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.rows import Rows, std_of, stretches
from rig.tick.layout import SAMPLE_LOST
from rig.tick.sequencer.repetition import LARGEST_LOST

LARGEST_LOST_WITHIN = 0.02
"""Of the window of an instant: a gap is filled from the periods beside it, which are in the window."""


def lost_rows(rows: Rows) -> np.ndarray:
    """Return bool[n]: rows whose inputs are NaN, either lost in transfer or because the row is missing in a damaged journal."""
    return np.concatenate([np.zeros(0, bool), *map(_lost_in, stretches(rows))])


def _lost_in(rows: Rows) -> np.ndarray:
    inputs = rows["inputs"]
    empty = np.isnan(inputs[:, 0])  # the other channels are looked at only if the first has no reading somewhere
    if empty.any():
        empty = np.isnan(inputs).all(axis=1)
    return np.asarray(((rows["flags"] & SAMPLE_LOST) != 0) | empty)


def lost_warnings(lost: int, size: int) -> list[str]:
    """Return one line on the number of lost samples; an empty list if none was lost."""
    return [f"{lost} of {size} samples were lost in transmission"] if lost else []


def lost_objection(lost: int, size: int) -> str:
    """Object if more than 5 % of the ``size`` samples of a record were lost."""
    if lost <= LARGEST_LOST * size:
        return ""
    return f"{lost} of {size} samples were lost in transmission, allowed is up to {LARGEST_LOST:.0%}"


def windows(time_s: np.ndarray, half_s: np.ndarray, rate_hz: float, n_rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first row of each instant's window, and the row after its last one, int[n] each."""
    ends = np.stack([time_s - half_s, time_s + half_s])
    first, end = np.clip(np.rint(ends * rate_hz), 0, n_rows).astype(int)
    return first, end


def too_many_lost(lost: np.ndarray, first: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return bool[n]: windows ``first`` to ``end`` (int[n]) of which more than 2 % is lost; ``lost`` is bool[n_rows]."""
    count = np.concatenate([[0], np.cumsum(lost)])
    return np.asarray(count[end] - count[first] > LARGEST_LOST_WITHIN * (end - first))


def rms_of(rows: Rows) -> list[float]:
    """RMS of every channel without its mean, in the channel's unit. Lost samples are left out."""
    inputs = rows["inputs"][~lost_rows(rows)].astype(float)
    return [float(value) for value in inputs.std(axis=0)] if inputs.size else [math.nan] * rows["inputs"].shape[1]


def rms_of_force(bench: Bench, rows: Rows) -> float:
    """RMS of the force without its mean, all harmonics included, N, over all rows but the last; gaps are filled."""
    channel = bench.index_of("force")
    return std_of(bridged(stretch, slice(channel, channel + 1))[:, 0] for stretch in stretches(rows[: rows.size - 1]))


def bridged(rows: Rows, channels: slice = slice(None)) -> np.ndarray:
    """Return the inputs of all or some channels, float64[n, n_channels], with gaps filled.

    A gap is filled by the mean of the readings one period before and after, both taken at the same phase by linear
    interpolation. The error for a vibration that grows or drifts steadily is therefore of second order. Use this for windows
    and spectra, which need signals without gaps; the caller must leave out results within reach of a gap. Inputs without lost
    samples are returned as recorded.
    """
    columns = [stretch["inputs"][:, channels].astype(float) for stretch in stretches(rows)]
    inputs = np.concatenate(columns) if columns else rows["inputs"][:, channels].astype(float)
    lost = lost_rows(rows)
    if not lost.any() or lost.all():
        return inputs
    theta_rad = rows["theta_rad"].astype(float)
    known = np.flatnonzero(np.isfinite(theta_rad))  # rows may be missing in a damaged journal
    turns = np.interp(np.arange(theta_rad.size), known, np.unwrap(theta_rad[known]) / (2.0 * math.pi))
    there, at = turns[~lost], turns[lost]
    before, after = at - 1.0 >= there[0], at + 1.0 <= there[-1]
    for column in inputs.T:
        read = column[~lost]
        earlier, later = np.interp(at - 1.0, there, read), np.interp(at + 1.0, there, read)
        column[lost] = np.select(
            [before & after, before, after], [0.5 * (earlier + later), earlier, later], np.interp(at, there, read)
        )
    return inputs
