"""Figure of the timing of a wall-clock loop: histograms of wake-up, execution and response times."""

from collections.abc import Sequence

import numpy as np

from rig.drawing.page import grid, legend_below
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, Figure, title
from rig.errors import RecordingError
from rig.recording.reader import Recording
from rig.recording.stored import StoredTable

PACED = {"host": "paced by the host", "device": "paced by the device", "lockstep": "in lockstep with the device"}
"""Printed name of each recorded pacing."""

TIMES = {"wake_up": "wake-up", "execution": "execution", "response": "response"}
"""Times that are measured for every block, with their printed names."""

COLOURS = {"wake_up": MAIN, "execution": THIRD, "response": SECOND}


def draw_lateness(page: Figure, recording: Recording) -> None:
    """Draw the number of blocks by time, and the share of blocks that took longer.

    All parts are taken together; the deadline is dashed. Raises `RecordingError` if no loop of the recording ran by the wall
    clock.
    """
    loops = [part.end["loop"] for part in recording.parts if part.end is not None and "histograms" in part.end["loop"]]
    if not loops:
        raise RecordingError(f"{recording.path}: its loop did not run by the clock, there is no lateness to draw")
    counts, beyond = grid(page, 2, sharex=True)[:, 0]
    quantiles = {
        "wake_up": [loop["wake_up_us"] for loop in loops],
        "execution": [loop["execution_us"] for loop in loops],
        "response": [loop["response_us"] for loop in loops],
    }
    for key, colour in COLOURS.items():
        edges, blocks = together([loop["histograms"][key] for loop in loops])
        if not edges.size:
            continue
        label = f"{TIMES[key]}, largest {max(one['largest'] for one in quantiles[key]):.0f} µs"
        counts.plot(edges, blocks, ".", color=colour)  # a line would fill bins that hold nothing
        beyond.step(edges, exceedance(blocks), where="post", color=colour, label=label)
    for deadline_us in sorted({loop["deadline_us"] for loop in loops}):
        for axis in (counts, beyond):
            axis.axvline(deadline_us, color=REJECTED, ls="--", lw=0.9)
    counts.set(yscale="log", ylabel="blocks per bin")
    beyond.set(
        xscale="log", yscale="log", xlabel="time, µs (dashed: deadline)", ylabel="share of blocks that took longer"
    )
    legend_below(page, beyond)
    overruns = sum(loop["overruns"] for loop in loops)
    count = int(sum(sum(loop["histograms"]["execution"]["count"]) for loop in loops))
    pacings = {PACED.get(loop["real_time"]["pacing"], loop["real_time"]["pacing"]) for loop in loops}
    specimen = recording.configuration["bench"]["specimen"]["name"]
    title(page, f"{specimen}: {count} blocks, {overruns} overruns, {' and '.join(sorted(pacings))}")


def together(histograms: Sequence[StoredTable]) -> tuple[np.ndarray, np.ndarray]:
    """Add up several histograms; return the upper edges, us, in rising order, and the number of blocks of each bin."""
    edges = np.concatenate([np.asarray(one["upper_edge_us"], float) for one in histograms])
    counts = np.concatenate([np.asarray(one["count"], float) for one in histograms])
    found, place = np.unique(edges, return_inverse=True)
    return found, np.bincount(place.ravel(), counts, found.size)


def exceedance(counts: np.ndarray) -> np.ndarray:
    """Share of all blocks that lie beyond each bin; NaN, which is not drawn, if none does."""
    share = 1.0 - np.cumsum(counts) / counts.sum()
    return np.where(share > 0.5 / counts.sum(), share, np.nan)
