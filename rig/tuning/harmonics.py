"""The harmonics loop of a tuned plan: its plant at each harmonic as measured, and a gain that is stable on it."""

import math
from dataclasses import dataclass

import numpy as np

from controller.harmonics import MOST_HARMONICS, HarmonicsSettings
from identification import FrequencyResponseMatrix
from rig.bench import Bench
from rig.errors import ConfigurationError
from rig.tuning.levels import significant
from vibrolock.arrays import Complex, Float

EXAMINED_BAND = 0.7  # of the oscillator's frequency, on both sides of a harmonic: where its loop is examined
GAINS = (0.04, 0.03, 0.02, 0.01, 0.005)  # integral gains that are tried, the highest first; chosen
MAX_SENSITIVITY = 1.8  # largest max |S| of the harmonics loop; chosen
MAX_PLANT_ERROR = 0.1  # relative standard error of a harmonic's plant up to which it is used


@dataclass(frozen=True)
class HarmonicsChoice:
    """Settings of the harmonics loop, and why."""

    settings: HarmonicsSettings
    """The table of the plan."""
    sensitivity_peaks: dict[int, float]
    """max |S| by harmonic, on the measured responses, of those that are controlled with the measured plant."""
    reasons: tuple[str, ...]
    """Harmonics that are left to a step, or left alone, and why, one line each."""


def check_highest(bench: Bench, highest: int) -> None:
    """Raise `ConfigurationError` unless the bench's limits let a multisine reach beyond the highest harmonic."""
    ConfigurationError.unless_between("harmonics", highest, 2, MOST_HARMONICS)
    needed, allowed = band_for(bench, highest), bench.limits.frequency_hz[1]
    if needed > allowed:
        linear = bench.specimen.linear_frequency_hz
        raise ConfigurationError(
            f"the multisine would reach {needed:.4g} Hz, the bench {bench.name} allows up to {allowed:g} Hz, "
            f"enough for {max(1, int(allowed / linear - EXAMINED_BAND))}",
            field="harmonics",
            value=highest,
        )


def band_for(bench: Bench, highest: int) -> float:
    """Return the highest frequency (Hz) of a multisine that shows the plant at all harmonics up to ``highest``."""
    return (highest + EXAMINED_BAND + 0.1) * bench.specimen.linear_frequency_hz


def choose_harmonics(
    responses: FrequencyResponseMatrix, lead_samples: float, sample_rate_hz: float, lock_hz: float, highest: int
) -> HarmonicsChoice:
    """Choose the largest gain that is stable at all harmonics with max |S| up to 1.8 on the measured force per volt.

    The recorded voltage is that on the converter at whole samples; the rest of ``lead_samples`` is taken out of the responses,
    as the loop does. A harmonic whose plant is less certain than 10 % is left to the step that measures it when the test runs.
    One that is not stable with the smallest gain is left alone.
    """
    frequency = responses.frequency_hz
    late = (lead_samples % 1.0) / sample_rate_hz
    force = responses.value[:, 0, 0] * np.exp(2j * math.pi * frequency * late)
    std = responses.total_std[:, 0, 0]
    delay_s = lead_samples / sample_rate_hz
    reasons, known, corner = [], dict[int, complex](), HarmonicsSettings().corner
    for order in range(2, highest + 1):
        plant = _at(frequency, force, order * lock_hz)
        error = float(np.interp(order * lock_hz, frequency, std)) / abs(plant)
        if error <= MAX_PLANT_ERROR:
            known[order] = plant
        else:
            reasons.append(
                f"harmonic {order}: force per volt at {order * lock_hz:.5g} Hz is uncertain by {100.0 * error:.2g} %, "
                f"allowed is {100.0 * MAX_PLANT_ERROR:g} %: measured by a step when the test runs"
            )
    peaks: dict[float, dict[int, float]] = {}
    for gain in GAINS:
        peaks[gain] = {
            order: _sensitivity(frequency, force / plant, order * lock_hz, lock_hz, (gain, corner), delay_s)
            for order, plant in known.items()
        }
        if max(peaks[gain].values(), default=0.0) <= MAX_SENSITIVITY:
            break
    unstable = [order for order, peak in peaks[gain].items() if peak > MAX_SENSITIVITY]
    if unstable:  # others need not suffer from them
        others = [order for order in known if order not in unstable]
        gain = next(g for g in GAINS if all(peaks[g][order] <= MAX_SENSITIVITY for order in others))
        reasons += [
            f"harmonic {order}: left alone: not stable at {order * lock_hz:.5g} Hz, a mode is too near"
            for order in unstable
        ]
    used = {order: plant for order, plant in known.items() if order not in unstable}
    settings = HarmonicsSettings(
        highest=highest,
        integral=gain,
        left_alone=tuple(unstable),
        force_per_v={order: (significant(plant.real), significant(plant.imag)) for order, plant in used.items()},
    )
    return HarmonicsChoice(settings, {order: peaks[gain][order] for order in used}, tuple(reasons))


def _at(frequency: Float, values: Complex, at_hz: float) -> complex:
    return complex(np.interp(at_hz, frequency, values.real), np.interp(at_hz, frequency, values.imag))


def _sensitivity(
    frequency: Float, ratio: Complex, centre_hz: float, lock_hz: float, law: tuple[float, float], delay_s: float
) -> float:
    """Return max |S| of a harmonic's loop on the measured lines; infinite if it is unstable, by Nyquist's criterion.

    ``ratio`` [n] is the plant at ``frequency`` over that assumed. With the modulation nu, relative to the oscillator, the open
    loop is ``k w R(nu) exp(-i nu d)/(i nu (i nu + w))``; R is not symmetric, so that both signs of nu are examined.
    """
    (k, w), nu = law, (frequency - centre_hz) / lock_hz
    near = (np.abs(nu) < EXAMINED_BAND) & (np.abs(nu) > 1e-9)
    nu = nu[near]
    loop = k * w * ratio[near] * np.exp(-2j * math.pi * nu * lock_hz * delay_s) / (1j * nu * (1j * nu + w))
    # Around the integrator's pole the contour passes on the right: from nu < 0 to nu > 0 on a half circle, where L is k/s.
    below, above = loop[nu < 0.0], loop[nu > 0.0]
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 33)
    radius = float(np.min(np.abs(nu)))
    around = k * _at(nu, ratio[near], 0.0) / (radius * np.exp(1j * angle))
    values = 1.0 + np.concatenate([[0.0], below, around, above, [0.0]])
    windings = round(float(np.sum(np.angle(values[1:] / values[:-1]))) / (2.0 * math.pi))
    if windings != 0:
        return math.inf
    return float(np.max(1.0 / np.abs(1.0 + loop)))
