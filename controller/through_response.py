"""The loop that holds a force through the response: the part of the force that feeds the vibration sets its level."""

import math

import numpy as np
from pydantic import Field

from controller.primitives import log_ratio
from controller.settings import Settings
from vibrolock.compiled import Record, kernel

__all__ = ["REFERENCE", "REFERENCE_STATE", "ThroughResponseSettings"]

SLOPE_FORGETS = 0.5  # rate at which a slope is forgotten, over that of the loop it is for
STEEPEST = 10.0
UNMOVED = 1e-7  # square of a logarithm's change (0.03 %) below which a slope is not believed
SMALLEST_M = 1e-15  # no displacement is smaller than an atom's nucleus: a floor for logarithms

REFERENCE = np.dtype([("ki", "f8"), ("follows_slope", "i8"), ("dt_s", "f8")])
"""Parameters of the loop (one record). ``follows_slope``: whether its gain is divided by the slope of the force over the
response."""

REFERENCE_STATE = np.dtype(
    [
        ("log_displacement", "f8"),
        ("slope_known", "i8"),
        ("slow_x", "f8"),
        ("slow_f", "f8"),
        ("square_x", "f8"),
        ("product_xf", "f8"),
    ]
)
"""State of the loop (one record): logarithm of the displacement (m) that it wants; sums of the slope."""


class ThroughResponseSettings(Settings):
    """How a force is held through the response."""

    reference_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """Gain from the logarithm of the active force ratio to that of the response's level, 1/s."""

    def build_reference(self, dt_s: float, follows_slope: bool) -> np.ndarray:
        """One record of `REFERENCE`."""
        out = np.zeros(1, REFERENCE)
        out["ki"], out["follows_slope"], out["dt_s"] = self.reference_integral_per_s, follows_slope, dt_s
        return out


@kernel
def begin_reference(state: Record, displacement_m: float) -> None:
    """The loop takes over at the displacement that there is."""
    state.log_displacement = math.log(max(displacement_m, SMALLEST_M))
    state.slope_known = 0


@kernel
def force_at_lag(vibration: Record, held_n: float, wanted_lag: float, is_rms: bool) -> float:
    """The force ``held_n`` as it would be at the wanted lag (rad) and at rest, if the response stayed as it is.

    The part of the fundamental that feeds the vibration stays, ``F sin psi`` with the lag psi of the displacement,
    and so do the harmonics of a root mean square. It may be negative where the force brakes.
    """
    # the lag is that of the acceleration, whose sine is minus that of the displacement's: the ratio is the same
    fundamental = vibration.rest_force_n * math.sin(wanted_lag - vibration.rest_error_rad) / math.sin(wanted_lag)
    if not is_rms:
        return float(fundamental)
    above = max(held_n * held_n - 0.5 * vibration.force_n * vibration.force_n, 0.0)
    return math.copysign(math.sqrt(above + 0.5 * fundamental * fundamental), fundamental)


@kernel
def force_slope(parameters: Record, state: Record, vibration: Record, wanted_lag: float, omega: float) -> float:
    """``d ln(F sin psi)/d ln X`` as it was of late, by least squares with forgetting, within bounds; 1 where nothing moved.

    Where friction begins to slide it is 5 and more: the loop through the response would have so many times its gain.
    """
    active = vibration.rest_force_n * abs(math.sin(wanted_lag - vibration.rest_error_rad))
    if parameters.follows_slope == 0 or not active > 0.0:
        return 1.0
    x, f = math.log(vibration.rest_drive_m_s2 / (omega * omega)), math.log(active)
    if state.slope_known == 0:
        state.slope_known = 1
        state.slow_x, state.slow_f, state.square_x, state.product_xf = x, f, 0.0, 0.0
    gain = parameters.ki * parameters.dt_s
    state.slow_x += gain * (x - state.slow_x)
    state.slow_f += gain * (f - state.slow_f)
    x, f = x - state.slow_x, f - state.slow_f
    state.square_x += SLOPE_FORGETS * gain * (x * x - state.square_x)
    state.product_xf += SLOPE_FORGETS * gain * (x * f - state.product_xf)
    slope = (state.product_xf + UNMOVED) / (state.square_x + UNMOVED)
    return float(min(max(slope, 1.0), STEEPEST))


@kernel
def wanted_displacement(
    parameters: Record, state: Record, wanted_n: float, active_n: float, slope: float, saturated: bool, behind: int
) -> float:
    """One sample of the loop: the displacement (m) at which the active force should become ``wanted_n``.

    ``d ln X_ref/dt = (k/s) ln(F* sin psi*/(F sin psi))`` with the slope s; it waits while the output cannot follow.
    """
    error = log_ratio(wanted_n, active_n) / slope
    if behind >= 0 if error < 0.0 else (not saturated and behind <= 0):
        state.log_displacement += parameters.ki * parameters.dt_s * error
    return math.exp(state.log_displacement)
