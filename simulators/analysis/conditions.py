"""Conditions of a harmonic balance (a held level, and a phase lag or a frequency), and checks of a user's arguments.

The level is that of the stinger force (peak of its fundamental, or RMS of its harmonics), of the drive point's
displacement, or of the voltage. Each condition gives one real equation with relative residual, and its derivatives.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError

Held = Literal["force", "force-rms", "response", "voltage"]
Quantity = Literal["fundamental", "rms"]

_NAMES: dict[Held, tuple[str, str]] = {
    "force": ("force", "N"),
    "force-rms": ("force", "N RMS"),
    "response": ("response", "m"),
    "voltage": ("voltage", "V"),
}
_LAG_LIMITS_DEG = (-179.0, -1.0)  # deg; lags that may be asked for, one degree inside those of no active power; chosen
_SAMPLES_PER_HARMONIC = 4  # fewest samples in a period of the highest harmonic, twice the sampling theorem's; chosen
_MOVES_A_SITE = 0.01
"""A mode moves a site if its deflection there exceeds this share of the largest of all modes."""


def held_force(quantity: Quantity) -> Held:
    """Return the name of the condition that holds a force, by its fundamental or its RMS."""
    InputError.unless_one_of("quantity", quantity, ("fundamental", "rms"))
    return "force" if quantity == "fundamental" else "force-rms"


@dataclass(frozen=True)
class Conditions:
    """A level of force, response or voltage, and a phase lag or a frequency."""

    held: Held
    """``force``: peak of the force's fundamental (N). ``force-rms``: RMS of all its harmonics from the first on (N), without
    the mean, which piezoelectric sensors do not measure. ``response``: peak of the fundamental of the drive point's
    displacement (m). ``voltage``: amplitude of the voltage (V)."""
    level: float
    """Value of the level."""
    at: Literal["lag", "frequency"]
    """Lag ``arg F_1 - arg A_1`` of the drive-point acceleration behind the force (rad), or frequency (rad/s)."""
    value: float
    """Value of the lag or frequency."""

    def halfway_to(self, goal: "Conditions") -> "Conditions":
        """Return conditions halfway to ``goal``: geometric mean of the levels, arithmetic mean of lag or frequency."""
        middle = float(np.sqrt(self.level * goal.level))
        return replace(self, level=middle, value=0.5 * (self.value + goal.value))

    def __str__(self) -> str:
        name, unit = _NAMES[self.held]
        at = f"{np.degrees(self.value):g} deg" if self.at == "lag" else f"{self.value / (2.0 * np.pi):g} Hz"
        return f"{name} {self.level:g} {unit}, {self.at} {at}"

    def equations(self, unknowns: Float, responses: Complex, slopes: Complex) -> tuple[Float, Float]:
        """Return the residuals [2] of lag or frequency and of the level, and their derivatives [2, len(y)].

        ``responses`` [2, H + 1] are the harmonics of force and drive displacement; ``slopes`` [2, H + 1, len(y)] are their
        derivatives by the unknowns.
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

    def _level(self, unknowns: Float, responses: Complex, slopes: Complex) -> tuple[float, Float]:
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
        """Return the voltage that a linear rig with these gains (N/V, m/V) needs for the level."""
        gains = {"force": force_per_v, "force-rms": force_per_v / np.sqrt(2.0), "response": drive_per_v, "voltage": 1.0}
        return float(self.level / gains[self.held])


def positive(name: str, values: ArrayLike) -> Float:
    """Return ``values`` as a row; raise `ValueError` unless all are finite and above zero."""
    array = _row(name, values)
    for value in array[~((array > 0.0) & np.isfinite(array))]:
        raise InputError(field=name, value=value, allowed="above 0")
    return array


def levels(
    forces_n: ArrayLike | None, voltages_v: ArrayLike | None, amplitudes_m: ArrayLike | None
) -> tuple[Literal["force", "voltage", "response"], Float]:
    """Return the name and the values of the one quantity that is given; raise `ValueError` unless it is exactly one."""
    if forces_n is not None and voltages_v is None and amplitudes_m is None:
        return "force", positive("forces_n", forces_n)
    if voltages_v is not None and forces_n is None and amplitudes_m is None:
        return "voltage", positive("voltages_v", voltages_v)
    if amplitudes_m is not None and forces_n is None and voltages_v is None:
        return "response", positive("amplitudes_m", amplitudes_m)
    raise InputError("several or none given", field="forces_n, voltages_v, amplitudes_m", allowed="one of them")


def lags_rad(name: str, values: ArrayLike, *, rising: bool = False) -> Float:
    """Return phase lags in radians from degrees; raise `ValueError` if one is out of range or, on request, not rising."""
    array = _row(name, values)
    lowest, highest = _LAG_LIMITS_DEG
    for value in array[~((array >= lowest) & (array <= highest))]:
        raise InputError(field=name, value=value, allowed=f"{lowest:g} to {highest:g}")
    if rising and not np.all(np.diff(array) > 0.0):
        raise InputError("not rising", field=name, allowed="lags each above the one before")
    return np.radians(array)


def checked_harmonics(harmonics: int, samples: int) -> tuple[int, int]:
    """Return harmonics and samples after a check; the samples must resolve the highest harmonic and products of the sites."""
    for name, value in (("harmonics", harmonics), ("samples", samples)):
        if not isinstance(value, int | np.integer):
            raise InputError(field=name, value=value, allowed="a whole number")
    InputError.unless_at_least("harmonics", harmonics, 1)
    if samples < _SAMPLES_PER_HARMONIC * (harmonics + 1):
        allowed = f"at least {_SAMPLES_PER_HARMONIC * (harmonics + 1)} for {harmonics} harmonics"
        raise InputError(field="samples", value=samples, allowed=allowed)
    return harmonics, samples


def followed_mode(rig: VirtualRig, near_hz: float | None) -> int:
    """Return the index of the linear mode nearest to ``near_hz``, by default of the lowest mode that moves a nonlinear site."""
    modes = rig.linear_modes
    if near_hz is not None:
        return modes.nearest(float(positive("near_hz", [near_hz])[0]))
    m = rig.plant.n_mode
    moved = np.abs(np.vstack([rig.plant.site_rows[:, :m], rig.plant.site_rows[:, m : 2 * m]]) @ modes.vectors)
    largest = np.max(moved, axis=1, keepdims=True, initial=0.0)
    taking_part = np.any((moved > _MOVES_A_SITE * largest) & (largest > 0.0), axis=0) & (modes.frequency_hz > 0.0)
    if np.any(taking_part):
        return int(np.argmax(taking_part))
    return int(np.argmax(modes.frequency_hz > 0.0))


def _row(name: str, values: ArrayLike) -> Float:
    try:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(field=name, value=values, allowed="a number, or one row of numbers") from None
    if array.ndim != 1 or array.size == 0:
        raise InputError(f"shape {array.shape}", field=name, allowed="one row of at least one number")
    return array
