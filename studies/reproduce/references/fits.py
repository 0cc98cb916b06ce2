"""Fits of nonlinear state-space models as lines of a study's table."""

from collections.abc import Callable, Mapping

import numpy as np

from identification import PnlssFit, PnlssModel
from studies.reproduce.references.result import Line


def lines_of(
    fits: Mapping[str, PnlssFit], chosen: str, figures: Callable[[PnlssModel], Mapping[str, float]]
) -> tuple[Line, ...]:
    """Return a line for the linear start of the chosen fit and one for each fit; figures that are not finite are left out."""

    def finite(model: PnlssModel) -> dict[str, float]:
        return {key: value for key, value in figures(model).items() if np.isfinite(value)}

    linear = fits[chosen].linear
    lines = [Line("linear start", {} if linear is None else finite(linear))]
    for name, fit in fits.items():
        more = {"validation_percent": 100.0 * fit.validation_error, "seconds": float(fit.history.seconds[-1])}
        lines.append(Line(name, {**finite(fit.model), **more}, chosen=name == chosen))
    return tuple(lines)


def fit_text(name: str, fit: PnlssFit) -> str:
    """Return a line on a fit that has ended."""
    return f"{name}: iteration {fit.chosen} of {fit.history.iterations}, {fit.history.seconds[-1]:.1f} s"
