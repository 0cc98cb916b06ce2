"""Figure of a stepped-phase test: responses at constant level, drawn along their branches."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification import FrequencyResponse
from rig.campaigns.evaluation.figure import describe
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.style import REJECTED
from rig.drawing.style import title as heading
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw", "draw_stepped_phase"]

NEAR_DEG = 5.0  # of phase resonance: the point that is marked as resonant


def draw(page: "Figure", recording: Recording) -> None:
    """Draw every level of a recording along its branch."""
    draw_stepped_phase(
        page,
        recorded_frequency_responses(recording),
        held="RMS of the force" if recording.configuration["plan"].get("levels_rms_n") else "",
        title=describe(recording, "stepped phase"),
        lags_deg=sorted({(point.asked_phase_lag_deg or 0.0) + 180.0 for point in points_of(recording)}),
    )


def draw_stepped_phase(
    page: "Figure",
    responses: Sequence[FrequencyResponse],
    *,
    held: str = "",
    title: str = "",
    lags_deg: Sequence[float] = (),
) -> None:
    """Draw displacement amplitude, lag of the displacement, and force over frequency.

    ``page`` is an empty figure, about 9 by 6.4 inches. Points are joined in the order of measurement, so the line runs back
    where the response folds over. The line is interrupted where a requested lag (``lags_deg``) was not measured. The point
    nearest to phase resonance is filled. If the force was controlled, its level is a dashed line. If another quantity was
    ``held``, its name is the title of the legend.
    """
    from matplotlib import colormaps

    axes = page.subplot_mosaic([["amplitude", "lag"], ["amplitude", "force"]], width_ratios=(1.5, 1.0))
    amplitude, lag, force = axes["amplitude"], axes["lag"], axes["force"]
    micro = max(float(np.max(item.amplitude_m)) for item in responses) < 5e-4
    for number, item in enumerate(responses):
        colour = colormaps["viridis"](number / max(1, len(responses) - 1) * 0.85)
        label = item.label or f"{item.level:g} {item.level_unit}"
        gaps = _gaps(item, lags_deg)
        _branch(amplitude, item, item.amplitude_m * (1e6 if micro else 1e3), colour, gaps, label)
        _branch(lag, item, item.phase_lag_deg, colour, gaps)
        _branch(force, item, item.force_n, colour, gaps)
        if item.controlled == "force":
            force.axhline(item.level, color=colour, lw=0.9, ls="--")
    amplitude.set(xlabel="frequency, Hz", ylabel=f"displacement amplitude, {'µm' if micro else 'mm'}")
    amplitude.set_ylim(bottom=0.0)
    amplitude.legend(fontsize=8, title=held or None, title_fontsize=8)
    lag.set(ylabel="lag of displacement, deg")
    lag.axhline(90.0, color=REJECTED, lw=0.8)
    lag.sharex(amplitude)
    force.set(xlabel="frequency, Hz", ylabel="fundamental force, N")
    force.set_ylim(bottom=0.0)
    force.sharex(amplitude)
    heading(page, title)


def _gaps(item: FrequencyResponse, lags_deg: Sequence[float]) -> NDArray[np.intp]:
    """Return int[k]: the points before which at least one requested lag is missing."""
    if not len(lags_deg):
        return np.array([], dtype=np.intp)
    asked = np.sort(lags_deg)
    nearest = np.argmin(np.abs(np.subtract.outer(item.phase_lag_deg, asked)), axis=1)
    return np.flatnonzero(np.abs(np.diff(nearest)) > 1) + 1


def _branch(
    axis: "Axes",
    item: FrequencyResponse,
    values: NDArray[np.float64],
    colour: object,
    gaps: NDArray[np.intp],
    label: str | None = None,
) -> None:
    """Draw one level in the order of measurement, with its resonant point filled."""
    x, y = np.insert(item.frequency_hz, gaps, np.nan), np.insert(values, gaps, np.nan)
    axis.plot(x, y, "o-", ms=4, mfc="white", color=colour, label=label)
    resonant = int(np.argmin(np.abs(item.phase_lag_deg - 90.0)))
    if abs(item.phase_lag_deg[resonant] - 90.0) <= NEAR_DEG:
        axis.plot(item.frequency_hz[resonant], values[resonant], "o", ms=5, color=colour)
