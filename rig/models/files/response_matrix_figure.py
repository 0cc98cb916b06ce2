"""Figure of frequency responses: amplitude and phase of every path, with standard errors."""

from typing import TYPE_CHECKING

import numpy as np

from identification import FrequencyResponseMatrix
from rig.drawing.style import MAIN, SECOND, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_response_matrix"]

_COLOURS = (MAIN, SECOND, "#4f8f4f", "#8064a2")
_LINES = ("-", "--", ":", "-.")


def draw_response_matrix(page: "Figure", matrix: FrequencyResponseMatrix) -> None:
    """Draw one colour per output and one line style per input; thin lines are standard errors."""
    size, phase = page.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    errors = matrix.noise_std if matrix.total_covariance is None else matrix.total_std
    for row, output in enumerate(matrix.outputs):
        for column, source in enumerate(matrix.inputs):
            colour, line = _COLOURS[row % len(_COLOURS)], _LINES[column % len(_LINES)]
            value = matrix.value[:, row, column]
            label = f"{output.name} over {source.name}, {output.unit}/{source.unit}"
            size.semilogy(matrix.frequency_hz, np.abs(value), line, color=colour, lw=1.0, label=label)
            phase.plot(matrix.frequency_hz, np.degrees(np.angle(value)), line, color=colour, lw=0.8)
            if np.isfinite(errors[:, row, column]).any():
                size.semilogy(matrix.frequency_hz, errors[:, row, column], line, color=colour, lw=0.4, alpha=0.6)
    size.set(ylabel="frequency response")
    size.legend(fontsize=8)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    estimator = f", {matrix.estimator}" if matrix.estimator else ""
    title(page, f"{matrix.specimen or 'specimen'}: frequency responses{estimator}")
