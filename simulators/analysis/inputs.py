"""What the analyses are asked for, checked: every bad value is named with what is allowed."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simulators.virtual_rig import VirtualRig

__all__ = ["checked_harmonics", "followed_mode", "lags_rad", "levels", "positive"]

Real = NDArray[np.float64]

_LAG_LIMITS_DEG = (-179.0, -1.0)
_SAMPLES_PER_HARMONIC = 4
_MOVES_A_SITE = 0.01
"""Share of the largest deflection that any mode has at a site from which on a mode moves it."""


def positive(name: str, values: ArrayLike) -> Real:
    """``values`` as a row of finite numbers above zero."""
    array = _row(name, values)
    for value in array[~((array > 0.0) & np.isfinite(array))]:
        raise ValueError(f"{name} = {value:g}: allowed is above 0")
    return array


def levels(
    forces_n: ArrayLike | None, voltages_v: ArrayLike | None, amplitudes_m: ArrayLike | None
) -> tuple[Literal["force", "voltage", "response"], Real]:
    """Which of the three is given, and its values."""
    if forces_n is not None and voltages_v is None and amplitudes_m is None:
        return "force", positive("forces_n", forces_n)
    if voltages_v is not None and forces_n is None and amplitudes_m is None:
        return "voltage", positive("voltages_v", voltages_v)
    if amplitudes_m is not None and forces_n is None and voltages_v is None:
        return "response", positive("amplitudes_m", amplitudes_m)
    raise ValueError("forces_n, voltages_v, amplitudes_m: several or none given, allowed is one of them")


def lags_rad(name: str, values: ArrayLike, *, rising: bool = False) -> Real:
    """Phase lags in radians from degrees."""
    array = _row(name, values)
    lowest, highest = _LAG_LIMITS_DEG
    for value in array[~((array >= lowest) & (array <= highest))]:
        raise ValueError(f"{name} = {value:g}: allowed is {lowest:g} to {highest:g}")
    if rising and not np.all(np.diff(array) > 0.0):
        raise ValueError(f"{name}: not rising, allowed are lags each above the one before")
    return np.radians(array)


def checked_harmonics(harmonics: int, samples: int) -> tuple[int, int]:
    """Highest harmonic and samples per period, which must resolve it and the products of the sites."""
    for name, value in (("harmonics", harmonics), ("samples", samples)):
        if not isinstance(value, int | np.integer):
            raise ValueError(f"{name} = {value!r}: allowed is a whole number")
    if harmonics < 1:
        raise ValueError(f"harmonics = {harmonics}: allowed is at least 1")
    if samples < _SAMPLES_PER_HARMONIC * (harmonics + 1):
        raise ValueError(
            f"samples = {samples}: allowed is at least {_SAMPLES_PER_HARMONIC * (harmonics + 1)} for {harmonics} harmonics"
        )
    return harmonics, samples


def followed_mode(rig: VirtualRig, near_hz: float | None) -> int:
    """Index of the linear mode nearest to ``near_hz``; without it, of the lowest that moves a nonlinear site."""
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


def _row(name: str, values: ArrayLike) -> Real:
    try:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {values!r}: allowed is a number, or one row of numbers") from None
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name}: shape {array.shape}, allowed is one row of at least one number")
    return array
