"""Figure of a model that is simulated: spectra and time of measured and simulated outputs, errors over the range used."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from identification.common import MOTION_UNIT
from rig.drawing.lines import pooled
from rig.drawing.page import grid
from rig.drawing.style import (
    MAIN,
    MARKERS,
    REJECTED,
    SECOND,
    THIRD,
    Axes,
    Figure,
    plain_log,
    say_why_empty,
    title,
    unit_text,
)

if TYPE_CHECKING:
    from identification import Channel, ErrorSpectra, OutputStretch
    from identification.experiments import Simulator
    from rig.results.simulated.model import SimulatedModel

_FLOOR = 0.1  # of the median residual: smaller values are not shown
_USES = {"training": (MAIN, "o"), "validation": (SECOND, "s"), "test": (REJECTED, "^")}


def draw_simulated(
    page: Figure, found: "SimulatedModel", heading: str, own: Mapping[str, Callable[[Axes], None] | None]
) -> None:
    """Draw the drive point's spectrum and a stretch of time, measured and simulated, the model's own panels, and all errors.

    Without a drive point, it is the first output. What the file does not hold is left out, and the title says so.
    """
    channel = _drawn(found.model)
    panels: dict[str, Callable[[Axes], None] | None] = {
        "spectra": partial(_spectra, spectra=found.spectra, channel=channel) if found.spectra else None,
        "time series": partial(_stretch, stretch=found.stretch, channel=channel) if found.stretch else None,
        **own,
        "errors of experiments": partial(_errors, found=found) if found.runs else None,
    }
    kept = [draw for draw in panels.values() if draw is not None]
    title(page, _title(found, heading, [name for name, draw in panels.items() if draw is None] if kept else []))
    if not kept:
        say_why_empty(page.subplots(), "a model from elsewhere: no data and no fit in the file")
        return
    axes = grid(page, (len(kept) + 1) // 2, min(2, len(kept))).ravel()
    for draw, axis in zip(kept, axes, strict=False):
        draw(axis)
    for axis in axes[len(kept) :]:
        axis.set_axis_off()


def channels_of(model: "Simulator") -> str:
    """Return the names of inputs and outputs."""
    inputs, outputs = (", ".join(channel.name for channel in side) for side in (model.inputs, model.outputs))
    return f"{inputs} to {outputs}"


def _title(found: "SimulatedModel", heading: str, left_out: Sequence[str]) -> str:
    lines = [heading]
    data, outputs = found.spectra or found.stretch, found.model.outputs
    if data is not None:
        use = next((f" ({run.use})" for run in found.runs if run.name == data.name), "")
        others = f", {_drawn(found.model).name}, one of {len(outputs)} outputs" if len(outputs) > 1 else ""
        lines.append(f"drawn: {data.name}{use}{others}")
    if left_out:
        lines.append(f"not in the file: {', '.join(left_out)}")
    return "; ".join(lines)


def _drawn(model: "Simulator") -> "Channel":
    return next((channel for channel in model.outputs if channel.role == "drive"), model.outputs[0])


def _with_unit(channel: "Channel") -> str:
    unit = "N" if channel.role == "force" else MOTION_UNIT.get(channel.motion, "") if channel.motion else ""
    return f"{channel.name}, {unit_text(unit)}" if unit else channel.name


def _spectra(axis: Axes, spectra: "ErrorSpectra", channel: "Channel") -> None:
    row, f = spectra.outputs.index(channel.name), spectra.frequency_hz
    dots = (
        (spectra.measured, REJECTED, 3.0, "measured"),
        (spectra.linear_error, THIRD, 1.2, "residual, linear model"),
        (spectra.error, SECOND, 1.2, "residual, this model"),
        (spectra.model, MAIN, 1.0, "this model"),
    )
    for values, colour, size, label in dots:
        if np.isfinite(values[row]).any():
            axis.semilogy(f, _positive(values[row]), ".", ms=size, color=colour, label=label)
    if np.isfinite(spectra.noise[row]).any():
        axis.semilogy(f, _positive(pooled(spectra.noise[row], 15)), "--", color="black", lw=0.9, label="noise")
    top = float(spectra.measured[row].max())
    errors = spectra.error[row][spectra.error[row] > 0.0]
    if top > 0.0:
        axis.set_ylim(_FLOOR * float(np.median(errors)) if errors.size else 1e-6 * top, 3.0 * top)
    largest = spectra.measured.max(axis=0)
    heard = f[largest > 1e-3 * largest.max()]
    axis.set(
        xlabel="frequency, Hz", ylabel=f"lines of {_with_unit(channel)}", xlim=(0.0, min(1.6 * heard.max(), f[-1]))
    )
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, markerscale=4, borderaxespad=0.2)


def _positive(values: np.ndarray) -> np.ndarray:
    return np.where(values > 0.0, values, np.nan)


def _stretch(axis: Axes, stretch: "OutputStretch", channel: "Channel") -> None:
    row = stretch.outputs.index(channel.name)
    measured, simulated = stretch.measured[row], stretch.simulated[row]
    axis.plot(stretch.time_s, measured, color=REJECTED, lw=3.0, alpha=0.6, label="measured")
    axis.plot(stretch.time_s, simulated, color=MAIN, lw=1.0, label="this model")
    axis.plot(stretch.time_s, simulated - measured, color=SECOND, lw=1.0, label="residual")
    top = 1.1 * float(np.abs(measured).max())
    axis.set(xlabel="time, s", ylabel=_with_unit(channel), ylim=(-top, top) if top > 0.0 else None)
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
    if np.isnan(simulated).any():
        axis.set_title("the run becomes unbounded", loc="right")


def _errors(axis: Axes, found: "SimulatedModel") -> None:
    bounded = [run for run in found.runs if run.bounded]
    lost = len(found.runs) - len(bounded)
    if not bounded:
        say_why_empty(axis, f"all {lost} runs become unbounded: no errors")
        return
    for use, (colour, mark) in (*_USES.items(), ("unknown use", (THIRD, MARKERS[3]))):
        of_use = [run for run in bounded if (run.use if run.use in _USES else "unknown use") == use]
        if of_use:
            errors = [100.0 * run.error.max() for run in of_use]
            axis.semilogy([run.range_use for run in of_use], errors, mark, color=colour, label=use)
    axis.axvline(1.0, color=REJECTED, lw=0.9, ls="--", label="largest of the training data")
    axis.set(xlabel="range use", ylabel="largest error, %", xlim=(0.0, 1.02 * axis.get_xlim()[1]))
    plain_log(axis)
    axis.legend(title=f"{lost} runs unbounded, not drawn" if lost else None)
