"""When a phase lock counts as gained and as lost, in degrees and periods."""

import math

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from controller.layout import THRESHOLDS

__all__ = ["LockRule"]


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
