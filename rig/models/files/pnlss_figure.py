"""Figure of a nonlinear state-space model: spectra and time of measured and simulated outputs, history of the fit, errors."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification.channels import MOTION_UNIT
from rig.drawing.lines import pooled
from rig.drawing.page import grid
from rig.drawing.style import MAIN, MARKERS, REJECTED, SECOND, THIRD, plain_log, say_why_empty, title, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification import Channel, ErrorSpectra, OutputStretch, PnlssFit, PnlssModel
    from rig.models.files.pnlss import IdentifiedPnlss

__all__ = ["draw_pnlss"]

_FLOOR = 0.1  # of the median residual: smaller values are not shown
_USES = {"training": (MAIN, "o"), "validation": (SECOND, "s"), "test": (REJECTED, "^")}


def draw_pnlss(page: "Figure", found: "IdentifiedPnlss") -> None:
    """Draw the drive point's spectrum and a stretch of time, measured and simulated, the course of the fit, and all errors.

    Without a drive point, it is the first output. What the file does not hold is left out, and the title says so.
    """
    kept = [name for name in ("spectra", "stretch", "fit", "runs") if getattr(found, name)]
    title(page, _title(found, kept))
    if not kept:
        say_why_empty(page.subplots(), "a model from elsewhere: no data and no fit in the file")
        return
    axes = grid(page, (len(kept) + 1) // 2, min(2, len(kept))).ravel()
    for name, axis in zip(kept, axes, strict=False):
        if name == "runs":
            _runs(axis, found)
        elif name == "fit" and found.fit is not None:
            _history(axis, found.fit)
        else:
            channel = _drawn(found.model)
            draw: Any = _spectra if name == "spectra" else _stretch
            draw(axis, getattr(found, name), channel.name, _unit(channel))
    for axis in axes[len(kept) :]:
        axis.set_axis_off()


def _drawn(model: "PnlssModel") -> "Channel":
    """Return the output that is drawn."""
    return next((channel for channel in model.outputs if channel.role == "drive"), model.outputs[0])


def _title(found: "IdentifiedPnlss", kept: list[str]) -> str:
    """Return what the model is, on which data it is drawn, and what is left out."""
    model = found.model
    inputs, outputs = (", ".join(channel.name for channel in side) for side in (model.inputs, model.outputs))
    lines = [
        f"PNLSS model of {model.specimen or 'an unnamed specimen'}: {inputs} to {outputs}, {model.states} states, "
        f"{model.nonlinear_coefficients} nonlinear coefficients, {model.sample_rate_hz:g} Hz"
    ]
    data = found.spectra or found.stretch
    if data is not None:
        use = next((f" ({run.use})" for run in found.runs if run.name == data.name), "")
        others = f", {_drawn(model).name}, one of {len(model.outputs)} outputs" if len(model.outputs) > 1 else ""
        lines.append(f"drawn: {data.name}{use}{others}")
    missing = {"spectra": "spectra", "stretch": "time series", "fit": "fit", "runs": "errors of experiments"}
    left_out = [text for name, text in missing.items() if name not in kept]
    if left_out and kept:
        lines.append(f"not in the file: {', '.join(left_out)}")
    return "; ".join(lines)


def _unit(channel: "Channel") -> str:
    """Return the unit of a channel; an empty string if it is unknown."""
    return "N" if channel.role == "force" else MOTION_UNIT.get(channel.motion, "") if channel.motion else ""


def _label(name: str, unit: str) -> str:
    return f"{name}, {unit_text(unit)}" if unit else name


def _spectra(axis: "Axes", spectra: "ErrorSpectra", name: str, unit: str) -> None:
    """Draw the amplitudes of one output: measured, model, errors of model and linear start, noise."""
    row, f = spectra.outputs.index(name), spectra.frequency_hz
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
    axis.set(xlabel="frequency, Hz", ylabel=f"lines of {_label(name, unit)}", xlim=(0.0, min(1.6 * heard.max(), f[-1])))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, markerscale=4, borderaxespad=0.2)


def _positive(values: np.ndarray) -> np.ndarray:
    """Replace values that a logarithmic axis cannot show by NaN."""
    return np.where(values > 0.0, values, np.nan)


def _stretch(axis: "Axes", stretch: "OutputStretch", name: str, unit: str) -> None:
    """Draw one output over time: measured, model, and the residual."""
    row = stretch.outputs.index(name)
    measured, simulated = stretch.measured[row], stretch.simulated[row]
    axis.plot(stretch.time_s, measured, color=REJECTED, lw=3.0, alpha=0.6, label="measured")
    axis.plot(stretch.time_s, simulated, color=MAIN, lw=1.0, label="this model")
    axis.plot(stretch.time_s, simulated - measured, color=SECOND, lw=1.0, label="residual")
    top = 1.1 * float(np.abs(measured).max())
    axis.set(xlabel="time, s", ylabel=_label(name, unit), ylim=(-top, top) if top > 0.0 else None)
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
    if np.isnan(simulated).any():
        axis.set_title("the run becomes unbounded", loc="right")


def _history(axis: "Axes", fit: "PnlssFit") -> None:
    """Draw training and validation error over the iterations, and mark the chosen iteration."""
    from matplotlib.ticker import MaxNLocator

    past = fit.history
    at = np.arange(past.training_error.size)
    line = "o-" if at.size == 1 else "-"
    axis.semilogy(at, 100.0 * past.training_error, line, color=MAIN, label="training")
    shown = np.where(np.isfinite(past.validation_error), past.validation_error, np.nan)
    if np.isfinite(shown).any():
        axis.semilogy(at, 100.0 * shown, line, color=SECOND, label="validation")
    axis.axvline(fit.chosen, color=REJECTED, lw=0.9, ls="--", label=f"chosen: iteration {fit.chosen}")
    unbounded = at[np.isinf(past.validation_error)]
    for number, bad in enumerate(unbounded):
        label = "validation run unbounded" if not number else None
        axis.axvline(bad, color=SECOND, lw=0.5, alpha=0.3, label=label)
    axis.set(xlabel="iteration", ylabel="relative error, %")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    plain_log(axis)
    axis.legend()


def _runs(axis: "Axes", found: "IdentifiedPnlss") -> None:
    """Draw the largest error of any output over the range used, one mark per experiment."""
    bounded = [run for run in found.runs if run.bounded]
    lost = len(found.runs) - len(bounded)
    if not bounded:
        say_why_empty(axis, f"all {lost} runs become unbounded: no errors")
        return
    for use, (colour, mark) in _USES.items():
        of_use = [run for run in bounded if run.use == use]
        if of_use:
            errors = [100.0 * run.error.max() for run in of_use]
            axis.semilogy([run.range_use for run in of_use], errors, mark, color=colour, label=use)
    others = [run for run in bounded if run.use not in _USES]
    if others:
        errors = [100.0 * run.error.max() for run in others]
        axis.semilogy([run.range_use for run in others], errors, MARKERS[3], color=THIRD, label="unknown use")
    axis.axvline(1.0, color=REJECTED, lw=0.9, ls="--", label="largest of the training data")
    axis.set(xlabel="range use", ylabel="largest error, %", xlim=(0.0, 1.02 * axis.get_xlim()[1]))
    plain_log(axis)
    axis.legend(title=f"{lost} runs unbounded, not drawn" if lost else None)
