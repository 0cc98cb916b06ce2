"""The loop that holds a force by controlling the response.

It adjusts the reference of the response from the active force, the part of the force that feeds power into the vibration.
"""

import math

import numpy as np
from pydantic import Field

from controller.primitives import log_ratio
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel

SLOPE_FORGETS = 0.5  # rate at which the slope estimate forgets, as a fraction of the loop's integral gain
STEEPEST = 10.0  # largest slope by which the loop's gain is divided; chosen
UNMOVED = 1e-7  # square of a logarithmic change (0.03 %) below which the slope estimate tends to 1
SMALLEST_M = 1e-15  # about the size of an atomic nucleus: lower bound of displacements in logarithms

REFERENCE = record(i8="follows_slope", f8="ki dt_s")
"""Parameters of the loop (one record). ``follows_slope``: whether the loop's gain is divided by the slope of the force over
the response."""

REFERENCE_STATE = record(i8="slope_known", f8="log_displacement slow_x slow_f square_x product_xf")
"""State of the loop (one record): logarithm of the wanted displacement (m), and sums for estimating the slope."""


class ThroughResponseSettings(Settings):
    """How a force is held through the response."""

    reference_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """r: gain from the logarithm of the active force ratio to that of the response's level, 1/s; above 0 with
    ``through-response``."""

    def build_reference(self, dt_s: float, follows_slope: bool) -> np.ndarray:
        """Return one record of `REFERENCE`."""
        out = np.zeros(1, REFERENCE)
        out["ki"], out["follows_slope"], out["dt_s"] = self.reference_integral_per_s, follows_slope, dt_s
        return out


@kernel
def begin_reference(state: Record, displacement_m: float) -> None:
    """Start the loop at the present displacement (m)."""
    state.log_displacement = math.log(max(displacement_m, SMALLEST_M))
    state.slope_known = 0


@kernel
def force_at_lag(vibration: Record, held_n: float, wanted_lag: float, is_rms: bool) -> float:
    """Return the force (N) that the present response would need at the wanted lag (rad) once it is steady.

    The active part of the fundamental, ``F sin psi`` with the lag psi of the displacement, is kept. For an RMS (``is_rms``) the
    harmonics contained in ``held_n`` are kept as well. The result is negative where the force brakes the vibration.
    """
    # wanted_lag refers to the acceleration; its sine is minus that of the displacement's lag, so that the ratio is the same
    fundamental = vibration.rest_force_n * math.sin(wanted_lag - vibration.rest_error_rad) / math.sin(wanted_lag)
    if not is_rms:
        return float(fundamental)
    above = max(held_n * held_n - 0.5 * vibration.force_n * vibration.force_n, 0.0)
    return math.copysign(math.sqrt(above + 0.5 * fundamental * fundamental), fundamental)


@kernel
def force_slope(parameters: Record, state: Record, vibration: Record, wanted_lag: float, omega: float) -> float:
    """Return the recent slope ``d ln(F sin psi)/d ln X``, by least squares with forgetting, within 1 and `STEEPEST`.

    The slope is 1 if the response has not changed. Where friction begins to slide it is 5 or more; without dividing by it, the
    gain of the loop would be that many times too high.
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
    parameters: Record,
    state: Record,
    wanted_n: float,
    active_n: float,
    slope: float,
    saturated: bool,
    saturation_sign: int,
) -> float:
    """Evaluate the loop for one sample: return the displacement (m) at which the active force should become ``wanted_n``.

    ``d ln X_ref/dt = (k/s) ln(F* sin psi*/(F sin psi))`` with the slope s. X_ref does not move while the output cannot follow.
    """
    error = log_ratio(wanted_n, active_n) / slope
    if saturation_sign >= 0 if error < 0.0 else (not saturated and saturation_sign <= 0):
        state.log_displacement += parameters.ki * parameters.dt_s * error
    return math.exp(state.log_displacement)
