"""Configuration of the phase-locked loop in SI units, and its frozen coefficients.

The paper (Scheel et al., appendix) gives a table of gains for a controller whose diagram its text source lacks. Two
readings fit the text and its sibling papers; both are presets and neither is claimed to be certain:

* reading B, ``two-phase``: force and response demodulated with the oscillator's phase through ``a/(s+a)``, the lag by
  the arctangent, ``Omega = omega_m + K1 e + K2 int e``; the force loop is ``U = K3 e_F + K4 int e_F``;
* reading A, ``sign``: the product of the signs of force and displacement through ``K2/(s+a)``, then ``(s+K1)/s``.

The sign product's mean is ``(2/pi) e``, so that reading A too is a PI law on e, with ``kp = (2/pi) K2/a`` and ``ki = K1 kp``.
"""

import math
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from controller.layout import LAW, THRESHOLDS, AmplitudeLaw, Detector

__all__ = ["LockRule", "PhaseLockedLoop", "preset"]


class LockRule(BaseModel):
    """When a phase lock counts as gained and as lost."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    locked_deg: float = Field(5.0, gt=0, le=45)
    """Mean phase error of a period below which the period counts as close, deg."""
    locked_periods: int = Field(10, ge=1, le=1000)
    """Close periods in a row that make a lock."""
    lost_deg: float = Field(30.0, gt=0, le=180)
    """Mean phase error of a period above which the period counts as far, deg."""
    lost_periods: int = Field(20, ge=1, le=1000)
    """Far periods in a row, at a held level, that lose a lock."""

    @model_validator(mode="after")
    def _ordered(self) -> "LockRule":
        if self.lost_deg <= self.locked_deg:
            raise ValueError(f"lost_deg = {self.lost_deg:g}: allowed is above locked_deg = {self.locked_deg:g}")
        return self

    def build(self, smallest_force_n: float, smallest_response: float) -> np.ndarray:
        """Thresholds record; the smallest amplitudes (N and the response's unit) come from the bench's sensors."""
        out = np.zeros(1, THRESHOLDS)
        out["locked_rad"] = math.radians(self.locked_deg)
        out["locked_periods"] = self.locked_periods
        out["lost_rad"] = math.radians(self.lost_deg)
        out["lost_periods"] = self.lost_periods
        out["smallest_force_n"] = smallest_force_n
        out["smallest_response"] = smallest_response
        return out


class PhaseLockedLoop(BaseModel):
    """Gains and bounds of the loop; `build` turns them into the record that the kernels read."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    detector: Literal["two-phase", "sign"] = "two-phase"
    """Phase detector: reading B (``two-phase``) or A (``sign``) of the paper's controller."""
    low_pass_rad_s: float = Field(gt=0, le=1e4)
    """a: corner of the detector's first-order low-pass, rad/s."""
    k1: float = Field(ge=0, le=1e4)
    """K1 of the paper: proportional gain in 1/s (two-phase), corner of the PI law in rad/s (sign)."""
    k2: float = Field(ge=0, le=1e6)
    """K2 of the paper: integral gain in 1/s^2 (two-phase), gain of the low-pass in rad/s (sign)."""
    k3: float = Field(0.0, ge=0, le=1e4)
    """K3 of the paper: proportional gain of the force loop, V/N."""
    k4: float = Field(0.0, ge=0, le=1e4)
    """K4 of the paper: integral gain of the force loop, V/(N s)."""
    centre_frequency_hz: float = Field(gt=0, le=1e5)
    """omega_m / 2 pi: frequency at which the loop starts, Hz."""
    frequency_window_hz: tuple[float, float]
    """Lowest and highest frequency the loop may take, Hz."""
    phase_lag_deg: float = Field(-90.0, ge=-180, le=180)
    """Wanted lag of the drive-point acceleration behind the force, deg; -90 is phase resonance."""
    mean_corner_hz: float = Field(0.3, gt=0, le=100)
    """Corner of the high-pass that takes the mean out of every input before it is demodulated, Hz."""
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
        return self

    def proportional_and_integral(self) -> tuple[float, float]:
        """``(kp, ki)`` of ``Omega = omega_m + kp e + ki int e``, in 1/s and 1/s^2, for e in rad."""
        if self.detector == "two-phase":
            return self.k1, self.k2
        kp = 2.0 / math.pi * self.k2 / self.low_pass_rad_s
        return kp, self.k1 * kp

    def build(self, sample_rate_hz: float, amplitude_law: AmplitudeLaw, largest_v: float) -> np.ndarray:
        """Coefficients for a sample rate: one record of `controller.layout.LAW`.

        ``largest_v`` is the largest output amplitude in V; the force loop does not integrate beyond it.
        Raises ValueError where the window reaches beyond a quarter of the sample rate or the force loop has no gain.
        """
        if self.frequency_window_hz[1] > sample_rate_hz / 4.0:
            raise ValueError(
                f"frequency_window_hz ends at {self.frequency_window_hz[1]:g} Hz; at {sample_rate_hz:g} samples/s "
                f"it may reach {sample_rate_hz / 4.0:g} Hz"
            )
        if amplitude_law is AmplitudeLaw.FORCE and self.k4 == 0.0:
            raise ValueError("k4 = 0: levels in newtons need the force loop's integral gain, allowed is above 0")
        dt = 1.0 / sample_rate_hz
        out = np.zeros(1, LAW)
        out["dt_s"] = dt
        out["detector"] = Detector.TWO_PHASE if self.detector == "two-phase" else Detector.SIGN
        out["target_lag_rad"] = math.radians(self.phase_lag_deg)
        out["demodulator_gain"] = -math.expm1(-self.low_pass_rad_s * dt)
        out["mean_gain"] = -math.expm1(-2.0 * math.pi * self.mean_corner_hz * dt)
        out["kp"], out["ki"] = self.proportional_and_integral()
        out["centre_rad_s"] = 2.0 * math.pi * self.centre_frequency_hz
        out["lowest_rad_s"], out["highest_rad_s"] = (2.0 * math.pi * f for f in self.frequency_window_hz)
        out["amplitude_law"] = amplitude_law
        out["k3"], out["k4"] = self.k3, self.k4
        out["largest_v"] = largest_v
        out["period_mean"] = self.period_mean
        return out


_PAPER = {
    # specimen: test -> K1, K2, K3, K4, omega_m (rad/s); a is 2 pi rad/s throughout. Table of the paper's appendix.
    ("magnet-beam", "stepped-phase"): (2.0, 2.0 * math.pi, 1.5, 1.0, 48.0 * math.pi),
    ("magnet-beam", "backbone"): (2.0, 2.0 * math.pi, 0.0, 0.0, 48.0 * math.pi),
    ("friction-beam", "stepped-phase"): (1.0, 10.0 * math.pi, 5.0, 1.0, 300.0 * math.pi),
    ("friction-beam", "backbone"): (1.0, 10.0 * math.pi, 0.0, 0.0, 290.0 * math.pi),
}


def preset(
    specimen: Literal["magnet-beam", "friction-beam"],
    test: Literal["backbone", "stepped-phase"] = "backbone",
    reading: Literal["A", "B"] = "B",
) -> PhaseLockedLoop:
    """The paper's controller for a specimen and a test, in reading A (sign detector) or B (two-phase).

    The paper gives no frequency window; +-10 % of the specimen's linear frequency is ours (24.37 and 149.0 Hz).
    """
    k1, k2, k3, k4, centre = _PAPER[specimen, test]
    linear_hz = {"magnet-beam": 24.37, "friction-beam": 149.0}[specimen]
    return PhaseLockedLoop(
        detector="two-phase" if reading == "B" else "sign",
        low_pass_rad_s=2.0 * math.pi,
        k1=k1,
        k2=k2,
        k3=k3,
        k4=k4,
        centre_frequency_hz=centre / (2.0 * math.pi),
        frequency_window_hz=(0.9 * linear_hz, 1.1 * linear_hz),
    )
