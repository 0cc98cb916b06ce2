"""The plant of a phase-locked loop: exciter and structure near one mode, from voltage to force and acceleration.

The structure responds to the force with its accelerance, ``A = Y(s) F``: one mode and the residuals of the other modes. Any
linear exciter obeys ``u = alpha(s) F + beta(s) A``, where alpha and beta do not depend on the structure. Together they give

    ``H_F = 1/(alpha + beta Y)``,  ``H_A = Y/(alpha + beta Y)``.

H_F and H_A are rational and share their poles. The structural mode can be changed alone (`PlantModel.at`), which represents a
nonlinear structure at another level. For a voltage-driven shaker with an elastic stinger alpha is a polynomial of degree 3
in s, and beta has the powers -2 to 1 of s.
"""

import cmath
import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from vibrolock.arrays import Complex
from vibrolock.errors import InputError

STANDARD_ERRORS = ("frequency_std_rad_s", "damping_ratio_std", "drive_shape_std", "force_v_n_std")

SLOWEST_POLE = (
    0.2  # of the mode's frequency, below which nothing is fitted; chosen: a third of the band's lowest frequency
)


@dataclass(frozen=True, kw_only=True)
class PlantModel:
    """Linear plant near a mode; ``H`` is for ``exp(s t)``, with the phase of the voltage taken at the converter."""

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
    """Frequency by which s is divided in the polynomials."""
    band_hz: tuple[float, float]
    """Frequency band of the fit."""
    fit_error: float
    """Largest of the two relative errors (root mean square over the band) of H_F and H_A that noise does not explain."""
    sample_rate_hz: float
    """Sample rate of the loop."""
    latency_samples: float
    """Delay common to all channels, from an output sample to the input sample that shows its effect, in samples."""
    frequency_std_rad_s: float | None = None
    """Standard error of the frequency; None if unknown."""
    damping_ratio_std: float | None = None
    """Standard error of the damping ratio; None if unknown."""
    drive_shape_std: float | None = None
    """Standard error of the mode shape at the drive point, kg^-1/2; None if unknown."""
    force_v_n_std: float | None = None
    """Standard error of alpha at the mode, V/N; None if unknown. What is measured is the sum ``alpha + beta Y``, which
    ``alpha + x`` and ``beta - x/Y`` give as well."""

    def __post_init__(self) -> None:
        for name in ("frequency_rad_s", "damping_ratio", "drive_shape", "centre_rad_s", "sample_rate_hz"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InputError(field=name, value=getattr(self, name), allowed="above 0")
        for name in STANDARD_ERRORS:
            std = getattr(self, name)
            if std is not None and not 0.0 <= std < math.inf:
                raise InputError(field=name, value=std, allowed="0 or more")
        if not 0.0 <= self.latency_samples < math.inf:
            raise InputError(field="latency_samples", value=self.latency_samples, allowed="0 or more")

    @property
    def delay_s(self) -> float:
        """Delay of the loop (s)."""
        return self.latency_samples / self.sample_rate_hz

    def accelerance(self, s: ArrayLike) -> Complex:
        """Return Y: acceleration of the drive point per force on the structure alone (1/kg), at complex s (rad/s)."""
        s = np.asarray(s, dtype=np.complex128)
        constant, rising = self.residual_per_kg
        return np.asarray(self.mode_accelerance(s) + constant + rising * (s / self.centre_rad_s) ** 2)

    def mode_accelerance(self, s: ArrayLike) -> Complex:
        """Return the part of Y that is due to the mode alone (1/kg), at complex s (rad/s)."""
        s = np.asarray(s, dtype=np.complex128)
        pole = s**2 + 2.0 * self.damping_ratio * self.frequency_rad_s * s + self.frequency_rad_s**2
        return np.asarray(self.drive_shape**2 * s**2 / pole)

    def exciter(self, s: ArrayLike) -> tuple[Complex, Complex]:
        """Return alpha (V/N) and beta (V s^2/m) of the exciter, ``u = alpha F + beta A``, at complex s."""
        z = np.asarray(s, dtype=np.complex128) / self.centre_rad_s
        alpha = np.polyval(np.array(self.force_v_n[::-1], np.complex128), z)
        beta = np.polyval(np.array(self.acceleration_v_s2_m[::-1], np.complex128), z) / z**2
        return np.asarray(alpha, np.complex128), np.asarray(beta, np.complex128)

    def force_per_v(self, s: ArrayLike) -> Complex:
        """Return H_F (N/V) at complex s, without the common delay."""
        alpha, beta = self.exciter(s)
        return np.asarray(1.0 / (alpha + beta * self.accelerance(s)))

    def acceleration_per_v(self, s: ArrayLike) -> Complex:
        """Return H_A (m/s^2/V) at complex s, without the common delay."""
        return np.asarray(self.accelerance(s) * self.force_per_v(s))

    @cached_property
    def poles_rad_s(self) -> Complex:
        """All poles of H_F and H_A (1/s); far from the band they belong to the fit and not to the rig."""
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
        """The pole of the coupled plant (1/s) that is nearest to the mode of the structure.

        Poles of less than `SLOWEST_POLE` of its frequency belong to the fit: where exciter and structure together are
        overdamped, they are nearer than those of the rig.
        """
        poles, omega = self.poles_rad_s, self.frequency_rad_s
        distance = np.abs(poles - 1j * omega)
        quick = np.abs(poles) > SLOWEST_POLE * omega
        return complex(poles[np.argmin(np.where(quick, distance, distance + 2.0 * omega))])

    def pole_offset_rad_s(self, lag_deg: float = -90.0) -> complex:
        """Return p (1/s): the coupled pole minus i times the frequency at which the loop locks for this lag."""
        return self.coupled_pole_rad_s - 1j * self.lock_frequency_rad_s(lag_deg)

    def lock_frequency_rad_s(self, lag_deg: float = -90.0) -> float:
        """Return the frequency (rad/s) near the mode at which the phase lag of the acceleration is ``lag_deg``.

        Raises ValueError if no frequency near the mode has this lag.
        """
        found = self._lock_frequencies.get(lag_deg)
        if found is None:
            found = self._lock_frequencies[lag_deg] = self._found_lock_frequency(lag_deg)
        return found

    @cached_property
    def _lock_frequencies(self) -> dict[float, float]:
        """What `lock_frequency_rad_s` has found, by lag: a design asks for the same one at every set of gains."""
        return {}

    def _found_lock_frequency(self, lag_deg: float) -> float:
        from scipy.optimize import brentq

        InputError.raise_if(not -180.0 < lag_deg < 0.0, field="lag_deg", value=lag_deg, allowed="between -180 and 0")
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
        raise InputError("the accelerance of this plant does not have it near the mode", field="lag_deg", value=lag_deg)

    def volts_per_newton(self, lag_deg: float = -90.0) -> float:
        """Return the voltage (peak) for one newton of force (peak) at the frequency with this lag."""
        return float(1.0 / abs(self.force_per_v(1j * self.lock_frequency_rad_s(lag_deg))))

    @property
    def exciter_mass_kg(self) -> complex:
        """beta/alpha at the mode: effective complex mass by which the exciter loads the drive point.

        The real part is m_ex, the moving mass reduced by the effect of the suspension's stiffness. The imaginary part is the
        exciter's damping divided by -w_0.
        """
        alpha, beta = self.exciter(1j * self.frequency_rad_s)
        return complex(beta / alpha)

    @property
    def mass_ratio(self) -> float:
        """Mass ratio mu = phi_d^2 m_ex: effective mass of the exciter over the modal mass."""
        return self.drive_shape**2 * self.exciter_mass_kg.real

    def at(self, frequency_rad_s: float | None = None, damping_ratio: float | None = None) -> Self:
        """Return the plant with another modal frequency and damping, as a nonlinear structure has at another level."""
        return replace(
            self,
            frequency_rad_s=self.frequency_rad_s if frequency_rad_s is None else frequency_rad_s,
            damping_ratio=self.damping_ratio if damping_ratio is None else damping_ratio,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the known fields as floats and lists of floats, for a table in a plan."""
        values = ((one.name, getattr(self, one.name)) for one in fields(self))
        return {name: _plain(value) for name, value in values if value is not None}

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
        covariance: ArrayLike | None = None,
        exciter_prior: float | None = None,
    ) -> Self:
        """Fit the plant to measured FRFs from voltage; see `controller.tuning.plant_fit.fitted`."""
        from controller.tuning.plant_fit import fitted

        found = fitted(
            frequency_hz,
            force_per_v,
            acceleration_per_v,
            force_std,
            acceleration_std,
            covariance,
            exciter_prior=exciter_prior,
        )
        return cls(**found, sample_rate_hz=sample_rate_hz, latency_samples=latency_samples)


def _plain(value: float | tuple[float, ...]) -> float | list[float]:
    return [float(v) for v in value] if isinstance(value, tuple) else float(value)
