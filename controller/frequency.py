"""The frequency law: sets the oscillator's frequency while the loop is closed."""

import math
from enum import IntEnum
from typing import Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from controller.primitives import proportional_integral
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel, kernel
from vibrolock.errors import InputError

LARGEST_FREQUENCY_ERROR = 0.05  # of the frequency


class FrequencyLaw(IntEnum):
    """Error that the PI law of the frequency acts on."""

    PHASE = 0
    """The phase error, rad."""
    FREQUENCY_ERROR = 1
    """Frequency at which the structure has the wanted phase, minus the oscillator's frequency, rad/s."""


PHASE, FREQUENCY_ERROR = int(FrequencyLaw.PHASE), int(FrequencyLaw.FREQUENCY_ERROR)
LAWS = {"phase": FrequencyLaw.PHASE, "frequency-error": FrequencyLaw.FREQUENCY_ERROR}
GAINS = {"phase": ("k1", "k2"), "frequency-error": ("frequency_proportional", "frequency_integral_per_s")}
"""Settings that are kp and ki of each law."""

FREQUENCY = record(
    i8="law period_mean feed_forward",
    f8="kp ki centre_rad_s lowest_rad_s highest_rad_s mode_shape_squared target_lag_rad dt_s most_softening most_hardening",
)
"""Parameters of the frequency law (one record). ``target_lag_rad``: wanted lag where the plan names none; ``most_softening``,
``most_hardening``: steepest backbone that the gains bear, ``-d ln(frequency)/d ln(level)`` and the same with plus, 0 if
unknown."""

FREQUENCY_STATE = record(i8="clamped taking_over", f8="omega integral mean_error_rad")
"""State of the frequency law (one record): the oscillator's frequency (rad/s), the PI law's integral (rad/s), the mean phase
error of the last whole period, whether the frequency is at an end of its window, and whether the law takes over at the next
sample."""


class FrequencySettings(Settings):
    """Error that the frequency follows, its gains and the frequency window.

    The frequency law is ``Omega = omega_m + kp e + ki int e``. With ``frequency_law = "phase"`` e is the phase error in rad
    and the gains are ``k1``, ``k2``. With ``"frequency-error"`` e is the frequency distance to the wanted phase in rad/s,
    ``eps = (phi_d^2 Omega / 2)(|F_1|/|A_1|) sin(phi* - lag)/|sin phi*|``, exact for one mode near resonance. It divides out the
    slope of the phase, which depends on the damping. Its gains are ``frequency_proportional`` and
    ``frequency_integral_per_s``.
    """

    frequency_law: Literal["phase", "frequency-error"] = "phase"
    """What the frequency follows: the phase error, or the frequency error computed from it."""
    k1: float = Field(0.0, ge=0, le=1e4)
    """K1 of the paper: proportional gain in 1/s (two-phase, adaptive), corner of the PI law in rad/s (sign). Must be given
    with the law ``phase``."""
    k2: float = Field(0.0, ge=0, le=1e6)
    """K2 of the paper: integral gain in 1/s^2 (two-phase, adaptive), gain of the low-pass in rad/s (sign). Must be given with
    the law ``phase``."""
    frequency_proportional: float = Field(0.0, ge=0, le=100)
    """Proportional gain of the frequency error, 1."""
    frequency_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """Integral gain of the frequency error, 1/s, above 0 with ``frequency-error``; w_LP/12 to w_LP/8 are good values."""
    drive_mode_shape: float | None = Field(None, gt=0)
    """Mass-normalised mode shape at the drive point for the frequency error, kg^-1/2; by default that of the plan's
    ``[plant]``, else the bench's. It may be wrong by a factor of 1.5."""
    centre_frequency_hz: float = Field(gt=0, le=1e5)
    """omega_m / 2 pi: frequency at which the loop starts, Hz, inside the window."""
    frequency_window_hz: tuple[float, float]
    """Lowest and highest frequency the loop may take, Hz. It keeps the loop off other modes, which look the same to a phase
    detector."""
    phase_lag_deg: float = Field(-90.0, ge=-180, le=180)
    """Wanted lag of the drive-point acceleration behind the force, deg; -90 is phase resonance. The ``sign`` detector knows
    -90 only; the frequency error stays 5 deg off 0 and 180."""
    period_mean: bool = False
    """Whether the frequency follows the mean of the phase error over the last whole period, instead of every sample of it:
    the detector's ripple then no longer modulates the output, whose harmonics change those of the force."""

    frequency_feed_forward: bool = False
    """Whether the frequency changes with the level during a ramp, by the slope of the frequency over the level that the points
    before have shown. The phase error then does not grow with the ramp's rate."""
    steepest_backbone: tuple[PositiveFloat, PositiveFloat] | None = None
    """Softening and hardening, both as a size of ``d ln(frequency)/d ln(level)``, with which the loops are still stable. A
    ramp to a higher level in metres gives it up where the backbone becomes steeper. Without it a ramp goes on until the lock is
    lost."""

    @model_validator(mode="after")
    def _frequency_possible(self) -> Self:
        lowest, highest = self.frequency_window_hz
        if not 0 < lowest < self.centre_frequency_hz < highest:
            raise ValueError(
                f"frequency_window_hz = [{lowest:g}, {highest:g}] must enclose "
                f"centre_frequency_hz = {self.centre_frequency_hz:g} and begin above 0"
            )
        if self.frequency_law == "phase":
            for name in ("k1", "k2"):
                if name not in self.model_fields_set:
                    raise InputError("is missing, and the phase law needs it", field=name)
            return self
        if self.frequency_integral_per_s == 0.0:
            raise InputError("the frequency-error law needs it above 0", field="frequency_integral_per_s", value=0)
        InputError.raise_if(self.period_mean, "allowed with the phase law only", field="period_mean", value=True)
        if abs(math.sin(math.radians(self.phase_lag_deg))) < math.sin(math.radians(5.0)):
            reason = "the frequency-error law allows -175 to -5 and 5 to 175"
            raise InputError(reason, field="phase_lag_deg", value=self.phase_lag_deg)
        return self

    def build_frequency(
        self, sample_rate_hz: float, drive_mode_shape: float | None, gains: tuple[float, float]
    ) -> np.ndarray:
        """Return one record of `FREQUENCY` for the PI law's ``gains`` (kp, ki) and the drive point's mode shape (kg^-1/2).

        Raises ValueError if the window reaches beyond a quarter of the sample rate, or if the frequency-error law lacks the
        mode shape.
        """
        if self.frequency_window_hz[1] > sample_rate_hz / 4.0:
            raise ValueError(
                f"frequency_window_hz ends at {self.frequency_window_hz[1]:g} Hz; at {sample_rate_hz:g} samples/s "
                f"it may reach {sample_rate_hz / 4.0:g} Hz"
            )
        if drive_mode_shape is None and self.frequency_law == "frequency-error":
            reason = "the frequency-error law needs it, here or as specimen.drive_mode_shape of the bench"
            raise InputError(reason, field="drive_mode_shape")
        out = np.zeros(1, FREQUENCY)
        out["law"] = LAWS[self.frequency_law]
        out["kp"], out["ki"] = gains
        out["centre_rad_s"] = 2.0 * math.pi * self.centre_frequency_hz
        out["lowest_rad_s"], out["highest_rad_s"] = (2.0 * math.pi * f for f in self.frequency_window_hz)
        out["period_mean"] = self.period_mean
        out["feed_forward"] = self.frequency_feed_forward
        out["most_softening"], out["most_hardening"] = self.steepest_backbone or (0.0, 0.0)
        out["mode_shape_squared"] = (drive_mode_shape or 0.0) ** 2
        out["target_lag_rad"] = math.radians(self.phase_lag_deg)
        out["dt_s"] = 1.0 / sample_rate_hz
        return out


@kernel
def frequency_error(phase_error: float, compliance: float, omega: float, wanted_lag: float) -> float:
    """Return the frequency error (rad/s): ``(Omega/2)(phi_d^2 |F|/|A|) sin e/|sin phi*|``.

    The frequency error is the frequency at which the mode has the wanted lag, minus the oscillator's. ``compliance`` is
    ``phi_d^2 |F_1|/|A_1|``; ``phase_error`` e is the wanted lag phi* minus the measured lag. With
    ``phi_d^2 F/A = 1 - (w/Omega)^2 - 2 i zeta w/Omega`` and phi* = -90 deg the error is ``w - Omega`` to first order: the slope
    of the phase over frequency, which depends on the damping, is divided out. The error is limited to
    `LARGEST_FREQUENCY_ERROR` times Omega.
    """
    bound = LARGEST_FREQUENCY_ERROR * omega
    error = 0.5 * omega * compliance * math.sin(phase_error) / abs(math.sin(wanted_lag))
    return float(min(max(error, -bound), bound))


@inner_kernel
def followed_error(parameters: Record, state: Record, vibration: Record, wanted_lag: float) -> float:
    """Return the error that the PI law acts on: a phase (rad) or a frequency error (rad/s), according to `FrequencyLaw`."""
    if parameters.law == FREQUENCY_ERROR:
        ratio = parameters.mode_shape_squared * vibration.rest_force_n / vibration.rest_drive_m_s2
        return frequency_error(vibration.rest_error_rad, ratio, state.omega, wanted_lag)
    return float(state.mean_error_rad if parameters.period_mean == 1 else vibration.error_rad)


@inner_kernel
def follow(parameters: Record, state: Record, vibration: Record, wanted_lag: float) -> None:
    """Evaluate the frequency law for one sample: update ``state.omega`` (rad/s) from the vibration and the wanted lag (rad).

    When the law takes over from a frequency given by the plan, its integral is set so that the frequency does not jump.
    """
    error = followed_error(parameters, state, vibration, wanted_lag)
    if state.taking_over == 1:
        state.taking_over = 0
        state.integral = state.omega - parameters.centre_rad_s - parameters.kp * error
    state.omega, state.integral = proportional_integral(
        error,
        state.integral,
        parameters.kp,
        parameters.ki,
        parameters.dt_s,
        parameters.centre_rad_s,
        parameters.lowest_rad_s,
        parameters.highest_rad_s,
    )
    state.clamped = 1 if state.omega == parameters.lowest_rad_s or state.omega == parameters.highest_rad_s else 0
