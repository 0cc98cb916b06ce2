"""The loops that hold a force or a response, in SI units."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from controller.layout import AmplitudeLaw, ForceLoop

__all__ = ["AmplitudeLoops"]

SMALLEST_PART = 1e-5  # of the largest voltage: where a logarithmic law begins from rest
FORCE_LOOPS = {
    "linear": ForceLoop.LINEAR,
    "logarithmic": ForceLoop.LOGARITHMIC,
    "through-response": ForceLoop.THROUGH_RESPONSE,
}


class AmplitudeLoops(BaseModel):
    """Gains of the loops behind levels in newtons and metres; `fill_amplitude` turns them into coefficients."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    force_loop: Literal["linear", "logarithmic", "through-response"] = "linear"
    """How a force is held: ``linear`` (K3, K4 of the paper), ``logarithmic`` (the same on logarithms: alike at every level),
    or ``through-response``: the active force sets the level of the response, which its own loop holds."""
    k3: float = Field(0.0, ge=0, le=1e4)
    """K3 of the paper: proportional gain of the linear force loop, V/N."""
    k4: float = Field(0.0, ge=0, le=1e4)
    """K4 of the paper: integral gain of the linear force loop, V/(N s)."""
    force_proportional: float = Field(0.3, ge=0, le=100)
    """Proportional gain of the logarithmic force loop, ln V per ln N."""
    force_integral_per_s: float = Field(2.0, gt=0, le=1e4)
    """Integral gain of the logarithmic force loop, 1/s."""
    response_loop: Literal["complex", "amplitude"] = "complex"
    """Whether the response's loop holds amplitude and phase (``complex``) or the amplitude alone."""
    response_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """K: integral gain of the response's loop, 1/s; 0 where there is none."""
    plant_pole_rad_s: tuple[float, float] | None = None
    """p: real and imaginary part of the plant's pole (voltage to response) less i times the locked frequency, rad/s. It sets
    the proportional gain K/(-p), which cancels it; without, the loop is integral alone."""
    plant_gain_per_v: tuple[float, float] | None = None
    """Real and imaginary part of the drive point's acceleration over the output, m/s^2 per V, at the lock at which
    `plant_pole_rad_s` holds. With it the proportional gain follows the pole as this ratio changes with the level."""
    reference_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """Gain from the logarithm of the active force ratio to that of the response's level, 1/s."""

    def fill_amplitude(self, out: np.ndarray, amplitude_law: AmplitudeLaw, largest_v: float) -> None:
        """Fill in a record of `controller.layout.LAW`; ValueError for levels that no loop would hold."""
        through = self.force_loop == "through-response"
        if amplitude_law in (AmplitudeLaw.FORCE, AmplitudeLaw.FORCE_RMS):
            if self.force_loop == "linear" and self.k4 == 0.0:
                raise ValueError("k4 = 0: levels in newtons need the force loop's integral gain, allowed is above 0")
            if through and self.reference_integral_per_s == 0.0:
                raise ValueError("reference_integral_per_s = 0: a force held through the response needs it above 0")
        held = amplitude_law is AmplitudeLaw.RESPONSE or (through and amplitude_law is not AmplitudeLaw.VOLTAGE)
        if held and self.response_integral_per_s == 0.0:
            raise ValueError("response_integral_per_s = 0: a response is held with a gain above 0")
        out["amplitude_law"] = amplitude_law
        out["force_loop"] = FORCE_LOOPS[self.force_loop]
        out["k3"], out["k4"] = self.k3, self.k4
        out["force_kp"], out["force_ki"] = self.force_proportional, self.force_integral_per_s
        out["response_kp"] = self._response_proportional()
        out["response_ki"] = self.response_integral_per_s
        out["plant_gain"] = 0.0 if self.plant_gain_per_v is None else complex(*self.plant_gain_per_v)
        out["turns"] = self.response_loop == "complex"
        out["reference_ki"] = self.reference_integral_per_s
        out["smallest_v"], out["largest_v"] = SMALLEST_PART * largest_v, largest_v

    def _response_proportional(self) -> complex:
        if self.plant_pole_rad_s is None:
            return 0.0
        pole = complex(*self.plant_pole_rad_s)
        if not pole.real < 0.0:
            raise ValueError(f"plant_pole_rad_s = {list(self.plant_pole_rad_s)}: allowed is a real part below 0")
        gain = self.response_integral_per_s / -pole
        return gain if self.response_loop == "complex" else gain.real
