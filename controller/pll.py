"""Configuration of the phase-locked loop in SI units, and its frozen coefficients."""

import math
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from controller.amplitude.loops import AmplitudeLoops
from controller.demodulation.settings import Demodulation
from controller.layout import LAW, AmplitudeLaw, FrequencyLaw
from controller.lock.rule import LockRule

__all__ = ["PhaseLockedLoop"]


class PhaseLockedLoop(Demodulation, AmplitudeLoops):
    """Gains and bounds of the loop; `build` turns them into the record that the kernels read.

    The frequency follows ``Omega = omega_m + kp e + ki int e``. With ``frequency_law = "phase"`` e is the phase error in rad
    and the gains are ``k1``, ``k2``. With ``"frequency-error"`` it is the distance to the wanted phase in rad/s,
    ``eps = (phi_d^2 Omega / 2)(|F_1|/|A_1|) sin(phi* - lag)/|sin phi*|``, exact for one mode near resonance: the slope of the
    phase, which goes with the damping, is divided out, and the gains are ``frequency_proportional`` and
    ``frequency_integral_per_s``.
    """

    frequency_law: Literal["phase", "frequency-error"] = "phase"
    """What the frequency follows: the phase error, or the frequency error computed from it."""
    k1: float = Field(0.0, ge=0, le=1e4)
    """K1 of the paper: proportional gain in 1/s (two-phase, adaptive), corner of the PI law in rad/s (sign)."""
    k2: float = Field(0.0, ge=0, le=1e6)
    """K2 of the paper: integral gain in 1/s^2 (two-phase, adaptive), gain of the low-pass in rad/s (sign)."""
    frequency_proportional: float = Field(0.0, ge=0, le=100)
    """Proportional gain of the frequency error, 1."""
    frequency_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """Integral gain of the frequency error, 1/s; w_LP/12 to w_LP/8 are good values."""
    rest_low_pass_rad_s: float = Field(0.0, ge=0, le=1e4)
    """Where above 0, frequency error and force through response go by the force that is left once the response keeps still:
    the part that changes it is taken out, with this corner for its rate of change, rad/s; w_LP is a good value. Neither then
    waits for the structure."""
    rest_share: float = Field(0.8, ge=0, le=1)
    """Part of that force which is taken out; what is left is room for a mode shape that is too small, with which the level
    runs away. Too large a mode shape only slows the loops down."""
    drive_mode_shape: float | None = Field(None, gt=0)
    """Mass-normalised mode shape at the drive point for the frequency error, kg^-1/2; the bench's if not given. It may be wrong
    by a factor of 1.5."""
    centre_frequency_hz: float = Field(gt=0, le=1e5)
    """omega_m / 2 pi: frequency at which the loop starts, Hz."""
    frequency_window_hz: tuple[float, float]
    """Lowest and highest frequency the loop may take, Hz."""
    phase_lag_deg: float = Field(-90.0, ge=-180, le=180)
    """Wanted lag of the drive-point acceleration behind the force, deg; -90 is phase resonance."""
    period_mean: bool = False
    """Whether the frequency follows the mean of the phase error over the last whole period, instead of every sample of it:
    the detector's ripple then no longer modulates the output, whose harmonics change those of the force."""
    lock: LockRule = LockRule()
    """When a lock counts as gained and as lost."""

    @model_validator(mode="after")
    def _consistent(self) -> "PhaseLockedLoop":
        lowest, highest = self.frequency_window_hz
        if not 0 < lowest < self.centre_frequency_hz < highest:
            raise ValueError(
                f"frequency_window_hz = [{lowest:g}, {highest:g}] must enclose "
                f"centre_frequency_hz = {self.centre_frequency_hz:g} and begin above 0"
            )
        if self.detector == "sign" and self.phase_lag_deg != -90.0:
            raise ValueError(
                f"phase_lag_deg = {self.phase_lag_deg:g}: the sign detector knows phase resonance only, allowed is -90"
            )
        if self.frequency_law == "phase":
            for name in ("k1", "k2"):
                if name not in self.model_fields_set:
                    raise ValueError(f"{name}: is missing, and the phase law needs it")
        else:
            self._frequency_error_possible()
        return self

    def _frequency_error_possible(self) -> None:
        if self.frequency_integral_per_s == 0.0:
            raise ValueError("frequency_integral_per_s = 0: the frequency-error law needs it above 0")
        if self.detector == "sign":
            raise ValueError(
                'detector = "sign": the frequency-error law needs amplitudes, allowed is two-phase or adaptive'
            )
        if self.period_mean:
            raise ValueError("period_mean = true: allowed with the phase law only")
        if abs(math.sin(math.radians(self.phase_lag_deg))) < math.sin(math.radians(5.0)):
            raise ValueError(
                f"phase_lag_deg = {self.phase_lag_deg:g}: the frequency-error law allows -175 to -5 and 5 to 175"
            )

    def proportional_and_integral(self) -> tuple[float, float]:
        """``(kp, ki)`` of the PI law: in 1/s and 1/s^2 for a phase error in rad, 1 and 1/s for a frequency error in rad/s."""
        if self.frequency_law == "frequency-error":
            return self.frequency_proportional, self.frequency_integral_per_s
        if self.detector != "sign":
            return self.k1, self.k2
        kp = 2.0 / math.pi * self.k2 / self.low_pass_rad_s
        return kp, self.k1 * kp

    def build(
        self,
        sample_rate_hz: float,
        amplitude_law: AmplitudeLaw,
        largest_v: float,
        drive_mode_shape: float | None = None,
    ) -> np.ndarray:
        """Coefficients for a sample rate: one record of `controller.layout.LAW`; see `controller.law.Law`.

        Raises ValueError where the window reaches beyond a quarter of the sample rate, the loop that would hold the level has
        no gain, or the frequency error lacks the mode shape.
        """
        if self.frequency_window_hz[1] > sample_rate_hz / 4.0:
            raise ValueError(
                f"frequency_window_hz ends at {self.frequency_window_hz[1]:g} Hz; at {sample_rate_hz:g} samples/s "
                f"it may reach {sample_rate_hz / 4.0:g} Hz"
            )
        shape = self.drive_mode_shape or drive_mode_shape
        needing = "the frequency-error law" if self.frequency_law == "frequency-error" else "rest_low_pass_rad_s"
        if shape is None and (self.frequency_law == "frequency-error" or self.rest_low_pass_rad_s > 0.0):
            raise ValueError(f"drive_mode_shape: {needing} needs it, here or as specimen.drive_mode_shape of the bench")
        out = np.zeros(1, LAW)
        self.fill_demodulation(out, sample_rate_hz)
        self.fill_amplitude(out, amplitude_law, largest_v)
        out["target_lag_rad"] = math.radians(self.phase_lag_deg)
        out["frequency_law"] = FrequencyLaw[self.frequency_law.upper().replace("-", "_")]
        out["mode_shape_squared"] = (shape or 0.0) ** 2
        out["rest_gain"] = -math.expm1(-self.rest_low_pass_rad_s / sample_rate_hz)
        out["kp"], out["ki"] = self.proportional_and_integral()
        out["rest_share"] = self.rest_share
        out["centre_rad_s"] = 2.0 * math.pi * self.centre_frequency_hz
        out["lowest_rad_s"], out["highest_rad_s"] = (2.0 * math.pi * f for f in self.frequency_window_hz)
        out["period_mean"] = self.period_mean
        return out
