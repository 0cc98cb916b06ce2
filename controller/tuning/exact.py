"""Gains from the exact map of the measured plant: the strongest integral action within a bound on the sensitivity."""

import math
from collections.abc import Sequence

import numpy as np

from controller.tuning.laws import ComplexResponseLaw, PhaseLaw
from controller.tuning.loop import ControlLoop
from controller.tuning.plant import PlantModel
from controller.tuning.stability import LARGEST_AT_HALF
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError


def exact_phase_law(
    plants: Sequence[PlantModel],
    low_pass_rad_s: float,
    *,
    sensitivity_peak: float = 1.6,
) -> PhaseLaw:
    """Return the phase PI law with the largest ki for which ``max |S| <= sensitivity_peak`` on every plant.

    For a given ratio kp/ki the bound ``|1 + g L| >= 1/sensitivity_peak`` is quadratic in the gain g at each frequency. The
    smallest positive root over all frequencies is the largest gain. As g = 0 is stable, every gain below it is stable too.
    Where no frequency bounds it, as with much damping, the loop gain at half the frequency does (`LARGEST_AT_HALF`).
    The ratio kp/ki is found by a grid and a bounded scalar search.
    """
    from scipy.optimize import minimize_scalar

    InputError.raise_if(not plants, "none given", field="plants", allowed="at least one")
    if not 1.0 < sensitivity_peak <= 4.0:
        raise InputError(field="sensitivity_peak", value=sensitivity_peak, allowed="above 1, up to 4")
    omega = [frequencies_for(plant) for plant in plants]
    unit = [
        ControlLoop(plant, low_pass_rad_s, PhaseLaw(0.0, 1.0)).frequency_loop_gain(1j * w)
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
    return PhaseLaw(ki * ratio, ki)


def complex_response_law(
    plant: PlantModel,
    low_pass_rad_s: float,
    *,
    share: float = 0.25,
    force_share: float = 0.0,
    smoothing_rad_s: float = math.inf,
    lag_deg: float = -90.0,
) -> ComplexResponseLaw:
    """Return a complex response law: ``K = share w_LP``, and kp = K/(-p) cancels the coupled pole p.

    The force loop has the gain ``force_share w_LP``. The error passes a low-pass with the corner ``smoothing_rad_s``.
    """
    gain = share * low_pass_rad_s
    pole = plant.pole_offset_rad_s(lag_deg)
    return ComplexResponseLaw(gain / -pole, gain, force_share * low_pass_rad_s, smoothing_rad_s)


def frequencies_for(plant: PlantModel, n: int = 1500) -> Float:
    """Return modulation frequencies [n] (rad/s) from 1e-4 to 0.5 times the mode's frequency, spaced geometrically."""
    return np.geomspace(1e-4, 0.5, n) * plant.frequency_rad_s


def _largest_gain(loop_gain: Complex, sensitivity_peak: float) -> float:
    """Return the largest g for which ``|1 + g L| >= 1/sensitivity_peak`` holds for all gains from 0 to g.

    The gain at the last frequency is at most `LARGEST_AT_HALF`.
    """
    size = np.abs(loop_gain) ** 2
    half = loop_gain.real / size
    inside = half**2 - (1.0 - sensitivity_peak**-2) / size
    meets = (half < 0.0) & (inside >= 0.0)
    quickest = LARGEST_AT_HALF / float(np.abs(loop_gain[-1]))
    return float(np.min(-half[meets] - np.sqrt(inside[meets]), initial=quickest))
