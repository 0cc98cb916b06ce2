"""Curves of predicted steady vibrations: stable and unstable parts, extrapolation, and where and why a curve ends."""

import numpy as np

from identification import SteadyPrediction
from rig.drawing.areas import broad
from rig.drawing.style import Axes, ColorType

BEYOND = 1.0
"""Range use above which a model extrapolates."""
UNSTABLE = (0, (1.2, 1.2))
"""Line style of unstable vibrations."""
_CUT = "the response from "
_VISIBLE = 0.15  # amplitude at a branch's end, over the largest, above which the end is explained; chosen
_SAME = 1e-6  # relative difference up to which two frequencies are one; chosen
_EDGE = "the range of the model ends"


def draw_curve(
    axis: Axes, response: SteadyPrediction, values: np.ndarray, colour: ColorType, label: str | None = None
) -> None:
    """Draw every branch separately; unstable parts are dotted, parts beyond the identified range have a broad shade.

    ``values``, float[n], are the quantity over the frequency. The label belongs to the first stable part.
    """
    for branch in np.unique(response.branch):
        on = response.branch == branch
        for which, line in ((response.stable[on], "-"), (~response.stable[on], UNSTABLE)):
            if not which.any():
                continue
            shown = np.where(with_neighbours(which), values[on], np.nan)
            axis.plot(response.frequency_hz[on], shown, ls=line, color=colour, label=label)
            label = None
        beyond = np.where(response.range_use[on] > BEYOND, values[on], np.nan)
        if np.isfinite(beyond).any():
            axis.plot(response.frequency_hz[on], beyond, color=colour, lw=broad(), alpha=0.25)


def draw_ends(axis: Axes, response: SteadyPrediction, values: np.ndarray, colour: ColorType) -> None:
    """Mark by a square where a curve ends within the figure."""
    ends = ends_within(response)
    axis.plot(response.frequency_hz[ends], values[ends], "s", color=colour)


def ends_within(response: SteadyPrediction) -> np.ndarray:
    """int[m]: points at which a curve ends before its amplitude has become small, other than at the ends of its band."""
    amplitude = response.amplitude_m()
    if response.force == "recorded":
        return np.zeros(0, dtype=np.int64)
    band = (
        (float(response.frequency_hz.min()), float(response.frequency_hz.max()))
        if not response.complete
        else (0.0, 0.0)
    )
    found = []
    for branch in np.unique(response.branch):
        on = np.flatnonzero(response.branch == branch)
        closed = bool(np.allclose(response.frequency_hz[on[0]], response.frequency_hz[on[-1]], rtol=_SAME)) and bool(
            np.allclose(amplitude[on[0]], amplitude[on[-1]])
        )
        for end in () if closed else (on[0], on[-1]):
            at_edge = any(abs(response.frequency_hz[end] - edge) <= _SAME * edge for edge in band)
            if not at_edge and amplitude[end] > _VISIBLE * amplitude.max():
                found.append(int(end))
    return np.array(found, dtype=np.int64)


def why_it_ends(response: SteadyPrediction) -> list[str]:
    """Return the reasons why a curve ends within the figure, without repetition; empty if it does not."""
    if not ends_within(response).size:
        return []
    notes = [note.split(": ", 1)[1] for note in response.notes if note.startswith(_CUT) and ": " in note]
    return list(dict.fromkeys(notes)) or [_EDGE]


def draw_stability(
    axis: Axes, x: np.ndarray, y: np.ndarray, stable: np.ndarray, colour: ColorType, *names: str
) -> None:
    """Draw a curve that may fold: stable parts as a line, unstable parts dotted; ``names`` are those of both in a legend."""
    axis.plot(x, np.where(with_neighbours(stable), y, np.nan), color=colour, label=names[0] if names else None)
    if not stable.all():
        shown = np.where(with_neighbours(~stable), y, np.nan)
        axis.plot(x, shown, ls=UNSTABLE, color=colour, label=names[1] if len(names) > 1 else None)


def with_neighbours(which: np.ndarray) -> np.ndarray:
    """True where a point or the one after it is selected, so that lines meet where stability changes."""
    return np.asarray(which | np.concatenate([which[1:], [False]]))
