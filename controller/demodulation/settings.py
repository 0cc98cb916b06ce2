"""How force and response are demodulated."""

import math
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from controller.layout import MOST_HARMONICS, Detector

__all__ = ["Demodulation"]

DETECTORS = {"two-phase": Detector.TWO_PHASE, "sign": Detector.SIGN, "adaptive": Detector.ADAPTIVE}


class Demodulation(BaseModel):
    """Detector and its low-pass; `fill_demodulation` turns them into coefficients."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    detector: Literal["two-phase", "sign", "adaptive"] = "two-phase"
    """``two-phase`` (reading B of the paper's controller), ``sign`` (reading A) or ``adaptive``: an adaptive filter, which
    takes harmonics and mean out and so may be ten times as quick."""
    low_pass_rad_s: float = Field(2.0 * math.pi, gt=0, le=1e4)
    """a, w_LP: corner of the demodulation's first-order low-pass, rad/s."""
    harmonics_followed: int = Field(5, ge=1, le=MOST_HARMONICS)
    """Harmonics of the adaptive filter; what is above makes ripple."""
    mean_corner_hz: float = Field(0.3, gt=0, le=100)
    """Corner of the high-pass that takes the mean out of every input before it is demodulated, Hz."""

    def fill_demodulation(self, out: np.ndarray, sample_rate_hz: float) -> None:
        """Fill in a record of `controller.layout.LAW`; ValueError where the filter is too quick for the sample rate."""
        dt = 1.0 / sample_rate_hz
        gain = -math.expm1(-self.low_pass_rad_s * dt)
        if self.detector == "adaptive" and gain * (2 * self.harmonics_followed + 1) > 1.0:
            largest = -math.log1p(-1.0 / (2 * self.harmonics_followed + 1)) / dt
            raise ValueError(
                f"low_pass_rad_s = {self.low_pass_rad_s:g}: an adaptive filter with {self.harmonics_followed} harmonics at "
                f"{sample_rate_hz:g} samples/s allows up to {largest:.4g}"
            )
        out["dt_s"] = dt
        out["detector"] = DETECTORS[self.detector]
        out["harmonics"] = self.harmonics_followed
        out["demodulator_gain"] = gain
        out["mean_gain"] = -math.expm1(-2.0 * math.pi * self.mean_corner_hz * dt)
