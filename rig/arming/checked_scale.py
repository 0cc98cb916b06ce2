"""The scale of force and motion as a check measured it at the resonance of the mode under test."""

import math
from dataclasses import dataclass

from vibrolock.errors import InputError


@dataclass(frozen=True, kw_only=True)
class CheckedScale:
    """What the bench gave at the resonance of the mode under test, at the small level of a check.

    Raises ValueError for a number that is not above 0.
    """

    at: str
    """Begin of the check, ISO 8601; empty if unknown."""
    frequency_hz: float
    """Natural frequency of the mode, Hz."""
    damping_ratio: float
    """Damping ratio of the mode."""
    acceleration_per_newton: float
    """Acceleration of the drive point over the force, 1/kg."""
    acceleration_per_volt: float
    """Acceleration of the drive point over the output, m/s^2/V."""

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "damping_ratio", "acceleration_per_newton", "acceleration_per_volt"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0.0 < value < math.inf):
                raise InputError(field=name, value=value, allowed="above 0")

    @property
    def newtons_per_volt(self) -> float:
        """Force over the output at resonance, N/V."""
        return self.acceleration_per_volt / self.acceleration_per_newton
