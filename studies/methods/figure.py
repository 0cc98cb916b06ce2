"""The figure of the race: periods of vibration against the worst error, one marker per method, one panel per rig."""

from pathlib import Path

from rig.drawing.page import grid, legend_below, page_for
from rig.drawing.style import COLOURS, MARKERS, REJECTED, title
from studies.methods.choice import DAMPING_WITHIN, FREQUENCY_WITHIN, together
from studies.methods.plans import METHODS
from studies.methods.race import Runs
from studies.methods.rigs import RIGS


def draw(runs: Runs, file: Path) -> None:
    """Draw all whole backbones under the noise as shipped. Filled: the exciter's force; open: a sinusoidal one."""
    with page_for(file, (9.0, 6.6)) as page:
        title(page, "a backbone of 13 levels by seven methods")
        panels = grid(page, 2, 3)
        for axis, rig in zip(panels.flat, RIGS, strict=True):
            for number, (method, what) in enumerate(METHODS.items()):
                for pure in (False, True) if what.pure else (False,):
                    found = _course(runs, rig, method, pure)
                    colour = COLOURS[number]
                    axis.plot(
                        *([x for x, _ in found], [y for _, y in found]),
                        marker=MARKERS[number],
                        color=colour,
                        mfc="none" if pure else colour,
                        lw=0.6,
                        label=None if pure else what.words,
                    )
            axis.axhline(1.0, color=REJECTED, lw=0.8)
            axis.set(xscale="log", yscale="log", title=rig, xlim=(60, 3e4), ylim=(0.01, 30.0))
            axis.set(xlabel="periods of vibration", ylabel="worst error over its bound")
            axis.label_outer()
        legend_below(page, *panels.flat)


def _course(runs: Runs, rig: str, method: str, pure: bool) -> list[tuple[float, float]]:
    """Return periods and the larger of both errors over its bound, of every knob, where all runs have all levels."""
    knobs = {row["knob"] for row in runs.rows if (row["rig"], row["method"], row["pure"]) == (rig, method, pure)}
    out = []
    for knob in sorted(knobs):
        known = runs.of((rig, method, pure, "1 x noise"), knob)
        if known and all(len(row["frequency_errors"]) == row["levels"] for row in known):
            one = together(known)
            error = max(one["worst_frequency"] / FREQUENCY_WITHIN, one["worst_damping"] / DAMPING_WITHIN)
            out.append((one["periods"], error))
    return out
