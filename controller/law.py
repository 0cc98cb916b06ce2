"""What the tick asks of a control law, and the law of open-loop excitation."""

import math
from typing import Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from controller.layout import LAW, AmplitudeLaw
from controller.pll import LockRule

__all__ = ["Law", "OpenLoop"]


class Law(Protocol):
    """A configured law: rules of the lock, and coefficients for a sample rate."""

    @property
    def lock(self) -> LockRule:
        """When a lock counts as gained and as lost."""

    def build(self, sample_rate_hz: float, amplitude_law: AmplitudeLaw, largest_v: float) -> np.ndarray:
        """One record of `controller.layout.LAW`; ValueError where the law does not fit."""


class OpenLoop(BaseModel):
    """No feedback: the plan gives frequency and voltage. Force and response are demodulated, to see them settle."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    low_pass_rad_s: float = Field(2.0 * math.pi, gt=0, le=1e4)
    """Corner of the first-order low-pass behind the demodulation, rad/s."""
    mean_corner_hz: float = Field(0.3, gt=0, le=100)
    """Corner of the high-pass that takes the mean out of every input before it is demodulated, Hz."""

    @property
    def lock(self) -> LockRule:
        """Rules of a lock that is never sought; they name the smallest amplitudes a phase can be read from."""
        return LockRule()

    def build(self, sample_rate_hz: float, amplitude_law: AmplitudeLaw, largest_v: float) -> np.ndarray:
        """Coefficients for a sample rate; ValueError for levels in newtons, which nothing would hold."""
        if amplitude_law is not AmplitudeLaw.VOLTAGE:
            raise ValueError("amplitude_law: levels in newtons need a force loop, allowed in open loop is volts")
        dt = 1.0 / sample_rate_hz
        out = np.zeros(1, LAW)
        out["dt_s"] = dt
        out["demodulator_gain"] = -math.expm1(-self.low_pass_rad_s * dt)
        out["mean_gain"] = -math.expm1(-2.0 * math.pi * self.mean_corner_hz * dt)
        out["amplitude_law"] = amplitude_law
        out["largest_v"] = largest_v
        return out
