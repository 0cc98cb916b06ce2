"""Figure of frequency responses: amplitude and phase of every path, with standard errors."""

from typing import TYPE_CHECKING

import numpy as np

from identification import FrequencyResponseMatrix
from rig.drawing.areas import is_narrow
from rig.drawing.lines import pooled, without_wraps
from rig.drawing.page import grid
from rig.drawing.style import COLOURS, REJECTED, title, unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = ("-", "--", ":", "-.")


def draw_response_matrix(page: "Figure", matrix: FrequencyResponseMatrix) -> None:
    """Draw one colour per output and one line style per input; thin lines are standard errors."""
    size, phase = grid(page, 2, 1, sharex=True, height_ratios=(2.0, 1.0))[:, 0]
    known = False
    errors = matrix.noise_std if matrix.total_covariance is None else matrix.total_std
    for row, output in enumerate(matrix.outputs):
        for column, source in enumerate(matrix.inputs):
            colour, line = COLOURS[row % len(COLOURS)], _LINES[column % len(_LINES)]
            value = matrix.value[:, row, column]
            label = f"{output.name} over {source.name}, {unit_text(f'{output.unit}/{source.unit}')}"
            size.semilogy(matrix.frequency_hz, np.abs(value), line, color=colour, label=label)
            phase.plot(matrix.frequency_hz, without_wraps(np.degrees(np.angle(value))), line, color=colour)
            if np.isfinite(errors[:, row, column]).any():
                known = True
                error = pooled(errors[:, row, column])
                size.semilogy(matrix.frequency_hz, error, line, color=colour, lw=0.7, alpha=0.6)
    size.set(ylabel="frequency response")
    if known:
        size.plot([], [], color=REJECTED, lw=0.7, label="thin: standard error")
    size.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1 if is_narrow(page) else 2, borderaxespad=0.2)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    estimator = f", {matrix.estimator}" if matrix.estimator else ""
    title(page, f"{matrix.specimen or 'specimen'}: frequency responses{estimator}")
