"""Periodic vibrations of a coupled rig as data, one entry per point, and the error if a vibration is not found."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError
from vibrolock.results import Result


@dataclass(frozen=True, eq=False, kw_only=True)
class PeriodicResponses(Result):
    """Periodic vibrations under the voltage ``U cos(theta)``, which has more harmonics where those of the force are controlled.

    Harmonics Y_h are defined by ``y = Re sum_h Y_h exp(i h theta)``.

    All values are true values of the rig in continuous time, without the sensors' high-pass, noise, and the hold of the
    converter (which reduces the fundamental of the voltage by ``sin(x)/x, x = pi f / sample_rate``).
    """

    frequency_hz: Float
    """Frequency of the vibration [n]."""
    voltage_v: Float
    """Amplitude U [n] of the fundamental of the voltage; NaN where the force itself was imposed."""
    force_n: Float
    """Peak of the fundamental of the stinger force [n]; see also `force_rms_n`."""
    amplitude_m: Float
    """Peak of the fundamental of the drive point's displacement [n]."""
    phase_lag_deg: Float
    """Lag ``arg F_1 - arg A_1`` of the drive point's acceleration behind the force [n], -180 to 180; -90 is resonance."""
    modal_frequency_hz: Float
    """Modal frequency w of the one-mode equation ``(w^2 - W^2 + 2 i W w z) q = phi_d F`` [n], as in identification."""
    modal_amplitude: Float
    """q = ``|X_d1| / phi_d`` [n] (kg^1/2 m), phi_d of the followed linear mode at the drive point."""
    damping_ratio: Float
    """Active power of the fundamental ``P_1 = 1/2 Re(F_1 conj(i W X_d1))`` as ``P_1 / (W^2 w q^2)`` [n]."""
    damping_ratio_total_power: Float
    """Damping ratio with the active power of all harmonics [n]."""
    force_harmonics_n: Complex
    """Stinger force [n, H + 1]."""
    drive_harmonics_m: Complex
    """Displacement of the drive point [n, H + 1]."""
    sensor_harmonics: dict[str, Complex]
    """True quantity at each sensor, by channel name [n, H + 1], N or m/s^2."""
    point_harmonics_m: dict[str, Complex]
    """Displacement of each named point of the structure [n, H + 1]."""
    site_harmonics: Complex
    """Coordinate of each nonlinear site [n, n_site, H + 1], in the order of ``rig.plant.site_rows``."""
    site_force_harmonics: Complex
    """Force of each nonlinear site [n, n_site, H + 1], without the linear part that belongs to the linear plant."""
    neglected_share: Float
    """RMS of the force harmonics H + 1 to 2 H + 1 that the motion would cause, over the fundamental [n]."""
    flags: NDArray[np.int64]
    """`simulators.layout.Flag` bits [n] that a run would raise: site out of its range, sensor or output clipped.

    The harmonic balance itself does not clip."""
    voltage_harmonics_v: Complex | None = None
    """Voltage [n, H + 1]: the fundamental U and, where harmonics of the force are controlled, the harmonics that this takes.

    None where the force itself was imposed."""
    stable: NDArray[np.bool_] | None = None
    """Stable at constant frequency and constant held level, judged by the folds of the curve [n].

    Controlled harmonics of the force are taken as held, here and in the two that follow."""
    stable_under_voltage: NDArray[np.bool_] | None = None
    """Stable at constant frequency and voltage [n]; None where the force itself was imposed."""
    level_slope: Float | None = None
    """``d ln(level) / d ln(U)`` [n] of the held level, at the held lag or frequency; None where the force was imposed.

    It is the static gain for a loop that adjusts the voltage by the level; if it is negative, no gain of the usual sign is
    stable."""

    @property
    def frequency_shift(self) -> float:
        """Modal frequency at the largest amplitude divided by that at the smallest amplitude, minus one."""
        smallest, largest = int(np.argmin(self.amplitude_m)), int(np.argmax(self.amplitude_m))
        return float(self.modal_frequency_hz[largest] / self.modal_frequency_hz[smallest] - 1.0)

    @property
    def force_rms_n(self) -> Float:
        """RMS of all harmonics of the stinger force from the first on [n]."""
        return np.asarray(np.sqrt(0.5 * np.sum(np.abs(self.force_harmonics_n[:, 1:]) ** 2, axis=1)))

    def force_harmonic_ratio(self, harmonic: int) -> Float:
        """Return ``|F_h / F_1|`` [n]; raise `ValueError` if the harmonic was not computed."""
        highest = self.force_harmonics_n.shape[1] - 1
        InputError.unless_between("harmonic", harmonic, 0, highest)
        return np.asarray(np.abs(self.force_harmonics_n[:, harmonic] / self.force_harmonics_n[:, 1]))


@dataclass(frozen=True, eq=False)
class HysteresisLoop:
    """Restoring force of one friction joint over its coordinate, one closed period."""

    coordinate: Float
    """Coordinate of the joint [N + 1]: m, or modal (kg^1/2 m) where the joint is relative to mode 1."""
    force: Float
    """Sum of the forces of the joint's elements [N + 1], linear part included: N, or the force conjugate to the coordinate."""

    @property
    def dissipated_j(self) -> float:
        """Energy dissipated per period (J): the area of the loop."""
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * np.diff(self.coordinate)))


class NotConvergedError(ArithmeticError):
    """No periodic vibration was found at a requested point: the level cannot be reached, or the path ends.

    The message names the point. ``found`` holds the points found before, in the requested order; None if there are none.
    """

    def __init__(self, message: str, found: "PeriodicResponses | None" = None) -> None:
        super().__init__(message)
        self.found = found
