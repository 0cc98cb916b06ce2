"""Gains from the exact map of the measured plant: the strongest integral action that a bound on the sensitivity leaves."""

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.tuning.laws import ComplexResponseLaw, FrequencyErrorLaw, LinearAmplitudeLaw, PhaseLaw
from controller.tuning.loop import ControlLoop
from controller.tuning.plant import PlantModel

__all__ = ["complex_response_law", "exact_phase_law", "exact_scheduled_law", "frequency_error_law"]

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def exact_phase_law(
    plants: Sequence[PlantModel],
    low_pass_rad_s: float,
    *,
    sensitivity_peak: float = 1.6,
    lag_deg: float = -90.0,
    amplitude_law: LinearAmplitudeLaw | None = None,
) -> PhaseLaw:
    """Phase PI of the largest ki with ``max |S| <= sensitivity_peak`` on every one of the plants.

    For a ratio kp/ki the bound ``|1 + g L| >= 1/sensitivity_peak`` is a quadratic in the gain g at each frequency: its smallest
    positive root over all frequencies is the largest gain, and as g = 0 is stable, so is everything below. The ratio is
    searched for.
    """
    return _best(plants, low_pass_rad_s, PhaseLaw, sensitivity_peak, lag_deg, amplitude_law)


def exact_scheduled_law(
    plants: Sequence[PlantModel],
    low_pass_rad_s: float,
    *,
    sensitivity_peak: float = 1.6,
    lag_deg: float = -90.0,
    amplitude_law: LinearAmplitudeLaw | None = None,
) -> FrequencyErrorLaw:
    """The same with gains that scale with the measured damping: a PI on the frequency error."""
    return _best(
        plants, low_pass_rad_s, lambda kp, ki: FrequencyErrorLaw(ki, kp), sensitivity_peak, lag_deg, amplitude_law
    )


def frequency_error_law(low_pass_rad_s: float, *, share: float = 1.0 / 12.0) -> FrequencyErrorLaw:
    """Integral frequency-error loop of gain ``share w_LP``: 1/12 suits where the coupled pole is far, 1/8 where it is near."""
    return FrequencyErrorLaw(share * low_pass_rad_s)


def complex_response_law(
    plant: PlantModel,
    low_pass_rad_s: float,
    *,
    share: float = 0.25,
    force_share: float = 0.0,
    smoothing_rad_s: float = math.inf,
    lag_deg: float = -90.0,
) -> ComplexResponseLaw:
    """Complex response control: ``K = share w_LP``, kp = K/(-p) cancels the coupled pole p.

    Force loop of gain ``force_share w_LP``; the error passes a low-pass of the corner ``smoothing_rad_s``.
    """
    gain = share * low_pass_rad_s
    pole = plant.pole_offset_rad_s(lag_deg)
    return ComplexResponseLaw(gain / -pole, gain, force_share * low_pass_rad_s, smoothing_rad_s)


def frequencies_for(plant: PlantModel, n: int = 1500) -> Real:
    """Frequencies of a slow change (rad/s), up to half the mode's, that resolve poles and zeros of every size [n]."""
    return np.geomspace(1e-4, 0.5, n) * plant.frequency_rad_s


Law = TypeVar("Law", PhaseLaw, FrequencyErrorLaw)


def _best(
    plants: Sequence[PlantModel],
    low_pass_rad_s: float,
    law_of: Callable[[float, float], Law],
    sensitivity_peak: float,
    lag_deg: float,
    amplitude_law: LinearAmplitudeLaw | None,
) -> Law:
    """Largest ki over the ratio kp/ki, by a grid and golden section."""
    from scipy.optimize import minimize_scalar

    if not plants:
        raise ValueError("plants: none given, allowed is at least one")
    if not 1.0 < sensitivity_peak <= 4.0:
        raise ValueError(f"sensitivity_peak = {sensitivity_peak:g}: allowed is above 1, up to 4")
    omega = [frequencies_for(plant) for plant in plants]
    unit = [
        ControlLoop(plant, low_pass_rad_s, law_of(0.0, 1.0), amplitude_law, lag_deg).frequency_loop_gain(1j * w)
        for plant, w in zip(plants, omega, strict=True)
    ]

    def integral(ratio_s: float) -> float:
        pairs = zip(omega, unit, strict=True)
        return min(_largest_gain(gain * (1.0 + 1j * w * ratio_s), sensitivity_peak) for w, gain in pairs)

    ratios = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 81) / low_pass_rad_s])
    values = [integral(ratio) for ratio in ratios]
    best = int(np.argmax(values))
    low, high = ratios[max(best - 1, 0)], ratios[min(best + 1, ratios.size - 1)]
    found = minimize_scalar(lambda ratio: -integral(ratio), bounds=(low, high), method="bounded")
    ratio = float(found.x) if -found.fun > values[best] else float(ratios[best])
    ki = integral(ratio)
    return law_of(ki * ratio, ki)


def _largest_gain(loop_gain: Complex, sensitivity_peak: float) -> float:
    """Largest g with ``|1 + g L| >= 1/sensitivity_peak`` for all gains from 0 to g."""
    size = np.abs(loop_gain) ** 2
    half = loop_gain.real / size
    inside = half**2 - (1.0 - sensitivity_peak**-2) / size
    meets = (half < 0.0) & (inside >= 0.0)
    return float(np.min(-half[meets] - np.sqrt(inside[meets]), initial=np.inf))
