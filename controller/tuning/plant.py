"""The plant that a phase-locked loop turns: exciter and structure near one mode, from voltage to force and acceleration.

The structure answers the force with its accelerance ``A = Y(s) F``, one mode and the residuals of the others; any
linear exciter is a relation ``u = alpha(s) F + beta(s) A`` that knows nothing of the structure. Both together give

    ``H_F = 1/(alpha + beta Y)``,  ``H_A = Y/(alpha + beta Y)``,

rational, with shared poles, and with a structural mode that can be moved alone (`PlantModel.at`), which is how a nonlinear
structure looks at another level. For a voltage-driven shaker behind an elastic stinger alpha and beta are polynomials:
alpha of degree 3 in s, beta of powers -2 to 1.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["PlantModel"]

Complex = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class PlantModel:
    """Linear plant near a mode; ``H`` for ``exp(s t)``, of a voltage whose phase is that on the converter."""

    frequency_rad_s: float
    """w_0: frequency of the mode of the structure alone."""
    damping_ratio: float
    """D: damping ratio of that mode."""
    drive_shape: float
    """phi_d: mass-normalised mode shape at the drive point, kg^-1/2."""
    residual_per_kg: tuple[float, float]
    """Accelerance of the other modes: a constant, and the factor of (s/centre)^2."""
    force_v_n: tuple[float, float, float, float]
    """alpha: volts per newton, coefficients of (s/centre)^0 to ^3."""
    acceleration_v_s2_m: tuple[float, float, float, float]
    """beta: volts per m/s^2, coefficients of (s/centre)^-2 to ^1."""
    centre_rad_s: float
    """Frequency that s is divided by in the polynomials."""
    band_hz: tuple[float, float]
    """Band that the model was fitted in."""
    fit_error: float
    """Largest of the two relative errors (root mean square over the band) of H_F and H_A."""
    sample_rate_hz: float
    """Sample rate of the loop."""
    latency_samples: float
    """Delay that is common to all channels, from an output to the input that shows it, in samples."""

    def __post_init__(self) -> None:
        for name in ("frequency_rad_s", "damping_ratio", "drive_shape", "centre_rad_s", "sample_rate_hz"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name):g}: allowed is above 0")
        if not 0.0 <= self.latency_samples < math.inf:
            raise ValueError(f"latency_samples = {self.latency_samples:g}: allowed is 0 or more")

    @property
    def delay_s(self) -> float:
        """Delay of the loop."""
        return self.latency_samples / self.sample_rate_hz

    def accelerance(self, s: ArrayLike) -> Complex:
        """Y: acceleration of the drive point per force on the structure alone (1/kg), at complex s (rad/s)."""
        s = np.asarray(s, dtype=np.complex128)
        constant, rising = self.residual_per_kg
        pole = s**2 + 2.0 * self.damping_ratio * self.frequency_rad_s * s + self.frequency_rad_s**2
        return np.asarray(self.drive_shape**2 * s**2 / pole + constant + rising * (s / self.centre_rad_s) ** 2)

    def exciter(self, s: ArrayLike) -> tuple[Complex, Complex]:
        """Exciter: alpha (V/N) and beta (V s^2/m) of ``u = alpha F + beta A`` at complex s."""
        z = np.asarray(s, dtype=np.complex128) / self.centre_rad_s
        alpha = np.polyval(np.array(self.force_v_n[::-1], np.complex128), z)
        beta = np.polyval(np.array(self.acceleration_v_s2_m[::-1], np.complex128), z) / z**2
        return np.asarray(alpha, np.complex128), np.asarray(beta, np.complex128)

    def force_per_v(self, s: ArrayLike) -> Complex:
        """H_F (N/V) at complex s, without the common delay."""
        alpha, beta = self.exciter(s)
        return np.asarray(1.0 / (alpha + beta * self.accelerance(s)))

    def acceleration_per_v(self, s: ArrayLike) -> Complex:
        """H_A (m/s^2/V) at complex s, without the common delay."""
        return np.asarray(self.accelerance(s) * self.force_per_v(s))

    @cached_property
    def poles_rad_s(self) -> Complex:
        """All poles of H_F and H_A (1/s); far from the band they are the fit's, not the rig's."""
        w, c = self.frequency_rad_s / self.centre_rad_s, self.centre_rad_s
        mode = np.array([1.0, 2.0 * self.damping_ratio * w, w**2])
        accelerance = np.polyadd(
            [self.drive_shape**2, 0.0, 0.0], np.polymul(mode, [self.residual_per_kg[1], 0.0, self.residual_per_kg[0]])
        )
        force = np.polymul(np.polymul(self.force_v_n[::-1], [1.0, 0.0, 0.0]), mode)
        roots = np.roots(np.polyadd(force, np.polymul(self.acceleration_v_s2_m[::-1], accelerance)))
        return np.asarray(c * roots, np.complex128)

    @property
    def coupled_pole_rad_s(self) -> complex:
        """The pole of the coupled plant (1/s) that is nearest to the mode of the structure."""
        poles = self.poles_rad_s
        return complex(poles[np.argmin(np.abs(poles - 1j * self.frequency_rad_s))])

    def pole_offset_rad_s(self, lag_deg: float = -90.0) -> complex:
        """p: the coupled pole as an offset from the frequency that the loop locks to at a lag (1/s)."""
        return self.coupled_pole_rad_s - 1j * self.lock_frequency_rad_s(lag_deg)

    def lock_frequency_rad_s(self, lag_deg: float = -90.0) -> float:
        """Frequency near the mode at which the acceleration lags the force by ``lag_deg``.

        Raises ValueError where no frequency near the mode does.
        """
        from scipy.optimize import brentq

        if not -180.0 < lag_deg < 0.0:
            raise ValueError(f"lag_deg = {lag_deg:g}: allowed is between -180 and 0")
        turn = cmath.exp(1j * math.radians(lag_deg))

        def error(omega: float) -> float:
            return cmath.phase(complex(self.accelerance(1j * omega)) * turn)

        bandwidth = self.damping_ratio * self.frequency_rad_s
        guess = self.frequency_rad_s - bandwidth / math.tan(math.radians(lag_deg)) * -1.0
        reach = bandwidth / math.sin(math.radians(lag_deg)) ** 2
        for width in (0.2 * reach, 0.8 * reach, 3.0 * reach):
            low, high = max(guess - width, 1e-3 * self.frequency_rad_s), guess + width
            if error(low) > 0.0 > error(high) and error(low) - error(high) < math.pi:
                return float(brentq(error, low, high, xtol=1e-12 * guess, rtol=1e-14))
        raise ValueError(f"lag_deg = {lag_deg:g}: the accelerance of this plant does not have it near the mode")

    def volts_per_newton(self, lag_deg: float = -90.0) -> float:
        """Voltage that a newton of force needs at the frequency of that lag, both peak."""
        return float(1.0 / abs(self.force_per_v(1j * self.lock_frequency_rad_s(lag_deg))))

    @property
    def exciter_mass_kg(self) -> complex:
        """beta/alpha at the mode: what the exciter hangs on the drive point, in effect.

        Its real part is m_ex, the moving mass (less its spring's); its imaginary part is damping, times -w_0.
        """
        alpha, beta = self.exciter(1j * self.frequency_rad_s)
        return complex(beta / alpha)

    @property
    def mass_ratio(self) -> float:
        """Mass ratio mu = phi_d^2 m_ex: by how much the exciter's mass loads the mode."""
        return self.drive_shape**2 * self.exciter_mass_kg.real

    def at(self, frequency_rad_s: float | None = None, damping_ratio: float | None = None) -> Self:
        """The plant with another modal frequency and damping, as a nonlinear structure has it at another level."""
        return replace(
            self,
            frequency_rad_s=self.frequency_rad_s if frequency_rad_s is None else frequency_rad_s,
            damping_ratio=self.damping_ratio if damping_ratio is None else damping_ratio,
        )

    def to_dict(self) -> dict[str, Any]:
        """Floats and lists of floats, for a table of a plan."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Self:
        """The model of `to_dict`; ValueError where a key is missing, unknown or not of the right shape."""
        names = {f.name for f in fields(cls)}
        if wrong := sorted(names.symmetric_difference(table)):
            raise ValueError(f"plant.{wrong[0]}: {'missing' if wrong[0] in names else 'not known'}")
        lengths = {"residual_per_kg": 2, "force_v_n": 4, "acceleration_v_s2_m": 4, "band_hz": 2}
        values: dict[str, Any] = {}
        for name, value in table.items():
            numbers = np.asarray(value, dtype=float)
            shape = (lengths[name],) if name in lengths else ()
            if numbers.shape != shape or not np.all(np.isfinite(numbers)):
                raise ValueError(f"plant.{name} = {value}: allowed is {shape or 'one'} finite number(s)")
            values[name] = tuple(map(float, numbers)) if shape else float(numbers)
        return cls(**values)

    @classmethod
    def from_frequency_responses(
        cls,
        frequency_hz: ArrayLike,
        force_per_v: ArrayLike,
        acceleration_per_v: ArrayLike,
        *,
        sample_rate_hz: float,
        latency_samples: float,
        force_std: ArrayLike | None = None,
        acceleration_std: ArrayLike | None = None,
    ) -> Self:
        """The plant from measured voltage FRFs; see `controller.tuning.plant_fit.fitted`."""
        from controller.tuning.plant_fit import fitted

        found = fitted(frequency_hz, force_per_v, acceleration_per_v, force_std, acceleration_std)
        return cls(**found, sample_rate_hz=sample_rate_hz, latency_samples=latency_samples)


def _plain(value: float | tuple[float, ...]) -> float | list[float]:
    return [float(v) for v in value] if isinstance(value, tuple) else float(value)
