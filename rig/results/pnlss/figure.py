"""Figure of a nonlinear state-space model: spectra and time of measured and simulated outputs, history of the fit, errors."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rig.drawing.style import MAIN, REJECTED, SECOND, plain_log
from rig.results.simulated.figure import channels_of, draw_simulated

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification import PnlssFit
    from rig.results.pnlss.model import IdentifiedPnlss


def draw_pnlss(page: "Figure", found: "IdentifiedPnlss") -> None:
    """Draw the drive point's spectrum and a stretch of time, measured and simulated, the course of the fit, and all errors."""
    model, fit = found.model, found.fit
    heading = (
        f"PNLSS model of {model.specimen or 'an unnamed specimen'}: {channels_of(model)}, {model.states} states, "
        f"{model.nonlinear_coefficients} nonlinear coefficients, {model.sample_rate_hz:g} Hz"
    )
    draw_simulated(page, found, heading, {"fit": None if fit is None else partial(_history, fit=fit)})


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
    if fit.limited:
        axis.set_title("stopped while it still paid", loc="right")
    plain_log(axis)
    axis.legend()
