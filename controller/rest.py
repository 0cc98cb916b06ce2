"""The steady force: estimates the force that the present vibration will need once its amplitude and phase are steady."""

import math

import numpy as np
from pydantic import Field

from controller.detector import phase_lag
from controller.primitives import size, wrap
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel
from vibrolock.errors import InputError

REST = record(f8="gain share mode_shape_squared dt_s")
"""Parameters of the estimate (one record).

``gain``: step of the low-pass used for the response's rate of change; 0 takes force and lag as measured. ``share``: part of
the force causing that rate of change which is subtracted. ``mode_shape_squared``: the drive point's mode shape squared
(1/kg)."""

REST_STATE = record(c16="late_force late_drive")
"""State of the estimate (one record): fundamentals of force and drive after one more low-pass."""


class RestSettings(Settings):
    """Whether the laws use the steady force instead of the measured force."""

    rest_low_pass_rad_s: float = Field(0.0, ge=0, le=1e4)
    """Above 0: the part of the force that changes the response is computed from the response's rate of change and subtracted.
    Frequency error and force through response then use the force of the steady vibration and need not wait for the structure.
    This is the corner of the low-pass for the rate of change, rad/s; w_LP is a good value."""
    rest_share: float = Field(0.8, ge=0, le=1)
    """Share of that part which is subtracted. With a mode shape that is too small too much would be subtracted, and the level
    would run away; what is left out is the margin. A mode shape that is too large only slows the loops down."""

    def build_rest(self, sample_rate_hz: float, drive_mode_shape: float | None) -> np.ndarray:
        """Return one record of `REST`; raise ValueError if the mode shape (kg^-1/2) is needed and missing."""
        if drive_mode_shape is None and self.rest_low_pass_rad_s > 0.0:
            reason = "rest_low_pass_rad_s needs it, here or as specimen.drive_mode_shape of the bench"
            raise InputError(reason, field="drive_mode_shape")
        out = np.zeros(1, REST)
        out["gain"] = -math.expm1(-self.rest_low_pass_rad_s / sample_rate_hz)
        out["share"] = self.rest_share
        out["mode_shape_squared"] = (drive_mode_shape or 0.0) ** 2
        out["dt_s"] = 1.0 / sample_rate_hz
        return out


@inner_kernel
def take_as_measured(state: Record, vibration: Record) -> None:
    """Without an estimate, set force, motion and phase error of the steady vibration to the measured values."""
    state.late_force, state.late_drive = vibration.force, vibration.drive
    vibration.rest_force_n, vibration.rest_drive_m_s2 = vibration.force_n, vibration.drive_m_s2
    vibration.rest_error_rad = vibration.error_rad


@inner_kernel
def estimate_steady_force(
    parameters: Record, state: Record, vibration: Record, omega: float, wanted_lag: float, lag_of_channels: float
) -> None:
    """Update the estimate with one sample, for the oscillator's frequency ``omega`` (rad/s) and ``wanted_lag`` (rad).

    A mode whose complex displacement X changes slowly needs ``phi_d^2 F = (w^2 - W^2 + 2 i z w W) X + 2 i W dX/dt``. The last
    term vanishes once the vibration is steady. Expressed by the acceleration it is ``F = -2 i/(W phi_d^2) dA/dt``, of which
    ``share`` is subtracted. Force and motion pass one more low-pass, which gives the derivative. With ``gain`` 0 force and lag
    are those measured.
    """
    if parameters.gain == 0.0:
        take_as_measured(state, vibration)
        return
    drive = vibration.drive
    if lag_of_channels != 0.0:
        drive *= complex(math.cos(lag_of_channels), math.sin(lag_of_channels))
    state.late_force += parameters.gain * (vibration.force - state.late_force)
    step = parameters.gain * (drive - state.late_drive)
    state.late_drive += step
    rest = state.late_force + step * complex(
        0.0, 2.0 * parameters.share / (omega * parameters.mode_shape_squared * parameters.dt_s)
    )
    vibration.rest_force_n, vibration.rest_drive_m_s2 = size(rest), size(state.late_drive)
    vibration.rest_error_rad = wrap(wanted_lag - phase_lag(rest, state.late_drive))
