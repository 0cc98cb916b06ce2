"""Response-controlled tests of rigs: a Duffing oscillator in closed form, and the shipped rigs by harmonic balance."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification import FrequencyResponse
from simulators import VirtualRig
from simulators.analysis import PeriodicResponses, constant_displacement_response, constant_force_response

OMEGA, ZETA, SHAPE, CUBIC = 2 * np.pi * 40.0, 0.004, 1.3, 3e8
LAGS_DEG = np.arange(30.0, 151.0, 10.0)
"""Lags of the displacement behind the force; those of the acceleration are 180 degrees less."""


def duffing_stiffness(
    omega: NDArray[np.float64], amplitude_m: ArrayLike, slips_m: float = 1.0
) -> NDArray[np.complex128]:
    """Dynamic stiffness of one mode with a cubic spring, one harmonic; from ``slips_m`` on its damping rises."""
    stiff = OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * np.square(amplitude_m)
    zeta = ZETA * (1.0 + 3.0 * np.maximum(np.log(np.asarray(amplitude_m) / slips_m), 0.0))
    return np.asarray((stiff - omega**2 + 2j * zeta * OMEGA * omega) / SHAPE**2)


def duffing_level(
    level_m: float,
    *,
    points: int = 9,
    noise: float = 0.0,
    missed: float = 0.0,
    seed: int = 0,
    slips_m: float = 1.0,
) -> FrequencyResponse:
    """One level stepped over the frequencies about its resonance; ``missed``: largest error of the amplitude held."""
    rng = np.random.default_rng(seed)
    resonance = np.sqrt(OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * level_m**2)
    omega = resonance * (1.0 + ZETA * np.linspace(-2.2, 2.2, points) * (1.0 if slips_m == 1.0 else 4.0))
    motion = level_m * (1.0 + missed * rng.uniform(-1, 1, points)) + 0j
    force = duffing_stiffness(omega, np.abs(motion), slips_m) * motion
    force = force * (1.0 + noise * (rng.normal(size=points) + 1j * rng.normal(size=points)))
    return FrequencyResponse(
        omega / (2 * np.pi), force, motion, "displacement", "response", level_m, f"{level_m:g} m", "d"
    )


@cache
def rig(specimen: str) -> VirtualRig:
    return VirtualRig.shipped(specimen)


@cache
def truth(specimen: str, force_n: float) -> PeriodicResponses:
    return constant_force_response(rig(specimen), force_n, LAGS_DEG - 180.0, harmonics=7, samples=256)


@cache
def measured(specimen: str, levels_m: tuple[float, ...], points: int) -> Sequence[FrequencyResponse]:
    """Levels stepped over lags."""
    lags = np.linspace(-153.0, -27.0, points)
    found = [constant_displacement_response(rig(specimen), x, lags, harmonics=7, samples=256) for x in levels_m]
    return [_level(specimen, level, one) for level, one in zip(levels_m, found, strict=True)]


def _level(specimen: str, level_m: float, found: PeriodicResponses) -> FrequencyResponse:
    motion = found.drive_harmonics_m[:, 1]
    force = found.force_harmonics_n[:, 1]
    return FrequencyResponse(
        found.frequency_hz, force, motion, "displacement", "response", level_m, f"{1e3 * level_m:.3g} mm", specimen
    )
