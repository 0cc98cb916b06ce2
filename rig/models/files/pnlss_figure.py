"""Figure of a nonlinear state-space model: spectra of outputs and errors, history of the fit, errors over range."""

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from identification.channels import MOTION_UNIT
from rig.drawing.style import MAIN, REJECTED, SECOND, plain_log, say_why_empty, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification import Channel, ErrorSpectra, PnlssFit
    from rig.models.files.pnlss import IdentifiedPnlss

__all__ = ["draw_pnlss"]

_MOST_OUTPUTS = 3
_FLOOR = 1e-6  # of the largest amplitude: smaller values are not shown


def draw_pnlss(page: "Figure", found: "IdentifiedPnlss") -> None:
    """Draw spectra on the left, one panel per output; on the right the fit's history and the range used by each run.

    If the file has neither spectra nor runs, as in a study, only the history is drawn.
    """
    model = found.model
    if found.spectra is None and not found.runs:
        _history(page.subplots(), found.fit)
    else:
        left, right = cast(Any, page.subfigures(1, 2, width_ratios=(1.5, 1.0)))
        _spectra(left, found.spectra, {channel.name: _unit(channel) for channel in model.outputs})
        history, runs = right.subplots(2, 1)
        _history(history, found.fit)
        _runs(runs, found)
    inputs, outputs = (", ".join(channel.name for channel in side) for side in (model.inputs, model.outputs))
    title(
        page,
        f"PNLSS model of {model.specimen or 'an unnamed specimen'}: {inputs} to {outputs}\n{model.states} states, "
        f"{model.nonlinear_coefficients} nonlinear coefficients, {model.sample_rate_hz:g} Hz",
    )


def _unit(channel: "Channel") -> str:
    """Return the unit of a channel; an empty string if it is unknown."""
    return "N" if channel.role == "force" else MOTION_UNIT.get(channel.motion, "") if channel.motion else ""


def _spectra(area: Any, spectra: "ErrorSpectra | None", units: dict[str, str]) -> None:
    """Draw the amplitudes of the measured outputs, of the linear start's error and of the model's error."""
    if spectra is None:
        say_why_empty(area.subplots(), "no periodic experiment, and so no spectra")
        return
    count = min(len(spectra.outputs), _MOST_OUTPUTS)
    axes = area.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for row, axis in enumerate(axes):
        for values, colour, label in (
            (spectra.measured, REJECTED, "measured"),
            (spectra.linear_error, SECOND, "error, linear start"),
            (spectra.error, MAIN, "error, model"),
        ):
            axis.semilogy(spectra.frequency_hz, _positive(values[row]), ".", ms=1.8, color=colour, label=label)
        top = float(spectra.measured[row].max())
        if top > 0.0:
            axis.set_ylim(_FLOOR * top, 2.0 * top)
        name = spectra.outputs[row]
        axis.set(ylabel=f"{name}, amplitude{f', {units[name]}' if units.get(name) else ''}")
    largest = spectra.measured.max(axis=0)
    heard = spectra.frequency_hz[largest > 1e-3 * largest.max()]
    axes[-1].set(xlabel="frequency, Hz", xlim=(0.0, min(1.6 * heard.max(), spectra.frequency_hz[-1])))
    axes[0].legend(loc="upper right", fontsize=7, markerscale=4)
    more = "" if count == len(spectra.outputs) else f", {count} of {len(spectra.outputs)} outputs"
    axes[0].set_title(f"{spectra.name}{more}", fontsize=8, loc="left")


def _positive(values: np.ndarray) -> np.ndarray:
    """Replace values that a logarithmic axis cannot show by NaN."""
    return np.where(values > 0.0, values, np.nan)


def _history(axis: "Axes", fit: "PnlssFit | None") -> None:
    """Draw training and validation error over the iterations, and mark the chosen iteration."""
    from matplotlib.ticker import MaxNLocator

    if fit is None:
        say_why_empty(axis, "a model from elsewhere: no history")
        return
    past = fit.history
    at = np.arange(past.training_error.size)
    axis.semilogy(at, 100.0 * past.training_error, color=MAIN, label="training")
    shown = np.where(np.isfinite(past.validation_error), past.validation_error, np.nan)
    if np.isfinite(shown).any():
        axis.semilogy(at, 100.0 * shown, color=SECOND, label="validation")
    axis.axvline(fit.chosen, color=REJECTED, lw=0.9, ls="--", label=f"chosen: iteration {fit.chosen}")
    for bad in at[np.isinf(past.validation_error)]:
        axis.axvline(bad, color=SECOND, lw=0.5, alpha=0.3)
    axis.set(xlabel="iteration", ylabel="relative error, %")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    plain_log(axis)
    axis.legend(fontsize=7)


def _runs(axis: "Axes", found: "IdentifiedPnlss") -> None:
    """Draw the largest error of any output over the range used, one mark per experiment."""
    bounded = [run for run in found.runs if run.bounded]
    if not bounded:
        say_why_empty(axis, "no bounded run" if found.runs else "no experiments")
        return
    for use, colour, mark in (("training", MAIN, "o"), ("validation", SECOND, "s"), ("test", REJECTED, "^")):
        of_use = [run for run in bounded if run.use == use]
        if of_use:
            axis.semilogy(
                [run.range_use for run in of_use],
                [100.0 * run.error.max() for run in of_use],
                mark,
                ms=4,
                color=colour,
                label=use,
            )
    axis.axvline(1.0, color=REJECTED, lw=0.8, ls="--")
    lost = len(found.runs) - len(bounded)
    axis.set(xlabel="range use (1: the training data's)", ylabel="largest error of any output, %")
    plain_log(axis)
    axis.legend(fontsize=7, title=f"{lost} runs unbounded" if lost else None, title_fontsize=7)
