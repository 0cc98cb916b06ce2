"""What closes the equations of a harmonic balance: a level that is held, and a phase lag or a frequency.

The level is that of the stinger force (peak of its fundamental, or RMS of its harmonics), of the drive point's
displacement, or of the voltage. Each condition gives one real equation whose residual is relative, and its slopes.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Conditions", "Held", "Quantity", "held_force"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Held = Literal["force", "force-rms", "response", "voltage"]
Quantity = Literal["fundamental", "rms"]

_NAMES: dict[Held, tuple[str, str]] = {
    "force": ("force", "N"),
    "force-rms": ("force", "N RMS"),
    "response": ("response", "m"),
    "voltage": ("voltage", "V"),
}


def held_force(quantity: Quantity) -> Held:
    """What is held where the force is, by its fundamental or by its RMS."""
    if quantity not in ("fundamental", "rms"):
        raise ValueError(f"quantity = {quantity!r}: allowed is fundamental or rms")
    return "force" if quantity == "fundamental" else "force-rms"


@dataclass(frozen=True)
class Conditions:
    """A level of force, response or voltage, and a phase lag or a frequency."""

    held: Held
    """``force``: peak of its fundamental (N). ``force-rms``: RMS of its harmonics from the first on (N), the mean left
    out, as piezoelectric sensors see none. ``response``: peak of the drive point's displacement, fundamental (m).
    ``voltage``: its amplitude (V)."""
    level: float
    """Its value."""
    at: Literal["lag", "frequency"]
    """Lag ``arg F_1 - arg A_1`` of the drive-point acceleration behind the force (rad), or frequency (rad/s)."""
    value: float
    """Its value."""

    def halfway_to(self, goal: "Conditions") -> "Conditions":
        """Geometric mean of the levels, arithmetic of lag or frequency."""
        middle = float(np.sqrt(self.level * goal.level))
        return replace(self, level=middle, value=0.5 * (self.value + goal.value))

    def __str__(self) -> str:
        name, unit = _NAMES[self.held]
        at = f"{np.degrees(self.value):g} deg" if self.at == "lag" else f"{self.value / (2.0 * np.pi):g} Hz"
        return f"{name} {self.level:g} {unit}, {self.at} {at}"

    def equations(self, unknowns: Real, responses: Complex, slopes: Complex) -> tuple[Real, Real]:
        """Residuals [2] of lag or frequency and of the level, and their slopes [2, len(y)].

        ``responses`` [2, H + 1] are the harmonics of force and drive displacement, ``slopes`` [2, H + 1, len(y)] theirs.
        """
        value, jacobian = np.zeros(2), np.zeros((2, unknowns.size))
        force, drive = responses[:, 1]
        if self.at == "lag":
            # The acceleration is minus W^2 times the displacement.
            value[0] = np.angle(-force / drive * np.exp(-1j * self.value))
            jacobian[0] = np.imag(slopes[0, 1] / force - slopes[1, 1] / drive)
        else:
            value[0] = unknowns[-2] / self.value - 1.0
            jacobian[0, -2] = 1.0 / self.value
        value[1], jacobian[1] = self._level(unknowns, responses, slopes)
        return value, jacobian

    def _level(self, unknowns: Real, responses: Complex, slopes: Complex) -> tuple[float, Real]:
        if self.held == "voltage":
            slope = np.zeros(unknowns.size)
            slope[-1] = 1.0 / self.level
            return unknowns[-1] / self.level - 1.0, slope
        row = 1 if self.held == "response" else 0
        last = None if self.held == "force-rms" else 2
        held, change = responses[row, 1:last], slopes[row, 1:last]
        power = np.sum(np.abs(held) ** 2)
        peak = np.sqrt(0.5 * power) if self.held == "force-rms" else np.sqrt(power)
        return float(np.log(peak / self.level)), np.asarray(np.real(np.conj(held) @ change) / power)

    def voltage_v(self, force_per_v: float, drive_per_v: float) -> float:
        """Voltage that a linear rig with these gains (N/V, m/V) needs for the level."""
        gains = {"force": force_per_v, "force-rms": force_per_v / np.sqrt(2.0), "response": drive_per_v, "voltage": 1.0}
        return float(self.level / gains[self.held])
