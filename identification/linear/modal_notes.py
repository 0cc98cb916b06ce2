"""What a user should know about the modes of a modal analysis."""

import numpy as np

from identification.linear.accelerance import WeightedResponses
from identification.linear.mode_correlation import mac_matrix
from identification.linear.modes import LinearModes

__all__ = ["modal_notes"]

_CLOSE_BANDWIDTHS = 2.0
_LINES_PER_BANDWIDTH = 2.0
_LARGEST_RESIDUAL = 1.3
_COLLINEAR = 0.95


def modal_notes(modes: LinearModes, data: WeightedResponses, converged: bool) -> list[str]:
    """Modes that are close, hardly resolved, complex, or badly fitted; one line each."""
    notes = [] if converged else ["the fit did not come to rest: the poles depend on where it began"]
    frequency, bandwidth = modes.frequency_hz, 2.0 * modes.damping_ratio * modes.frequency_hz
    alike = mac_matrix(modes, modes)
    for k in range(frequency.size - 1):
        apart = frequency[k + 1] - frequency[k]
        if apart < _CLOSE_BANDWIDTHS * 0.5 * (bandwidth[k] + bandwidth[k + 1]):
            notes.append(
                f"modes at {frequency[k]:.5g} and {frequency[k + 1]:.5g} Hz are close: {apart:.3g} Hz apart with half-power "
                f"bandwidths of {bandwidth[k]:.3g} and {bandwidth[k + 1]:.3g} Hz, MAC of their shapes {alike[k, k + 1]:.2f}"
            )
    for f, width in zip(frequency, bandwidth, strict=True):
        lines = np.count_nonzero(np.abs(data.frequency_hz - f) <= 0.5 * width)
        if width / _spacing(data, f) < _LINES_PER_BANDWIDTH:
            notes.append(
                f"mode at {f:.5g} Hz: half-power bandwidth {width:.3g} Hz holds {lines} lines; record longer periods for "
                "a damping ratio to rely on"
            )
    for f, collinear in zip(frequency, modes.phase_collinearity, strict=True):
        if collinear < _COLLINEAR:
            notes.append(f"mode at {f:.5g} Hz: phase collinearity {collinear:.2f}, shape is complex or poorly measured")
    if data.kind == "relative":
        notes.append("no covariance of the responses is known: errors are taken from the misfit of the model")
    elif data.kind == "noise":
        notes.append("errors from noise alone; nonlinear distortion is not in them (needs two realisations)")
    if modes.fit_residual > _LARGEST_RESIDUAL:
        notes.append(
            f"misfit is {modes.fit_residual:.2f} times what its errors let expect: modes missing, or not linear at this level"
        )
    return notes


def _spacing(data: WeightedResponses, frequency_hz: float) -> float:
    """Distance of the lines around a frequency, Hz."""
    index = int(np.clip(np.searchsorted(data.frequency_hz, frequency_hz), 1, data.frequency_hz.size - 1))
    return float(data.frequency_hz[index] - data.frequency_hz[index - 1])
