"""What a fault of a sensor or of the amplifier makes of its voltages, from its first sample on."""

import math
from collections.abc import Callable

import numpy as np

NOISE_V = 0.2e-3
RANGE_V = 5.0
SPIKE_V, SPIKE_EVERY = 2.5, 971
HUM_V, HUM_HZ = 0.05, 50.0
DRIFT_V_S = 0.1
FADING = 0.8  # of the sensitivity, a second
DROPOUT_S, DROPOUT_EVERY_S = 2e-3, 0.4
NUMBERS = np.random.default_rng(1).standard_normal(2**17)

Spoil = Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]
"""Of voltages [n], times since the fault began [n] (samples), the last voltage before it, and the sample rate (Hz)."""


def noise(at: np.ndarray) -> np.ndarray:
    """Normal numbers [n], the same for the same samples whatever the block."""
    return NUMBERS[at % NUMBERS.size]


def spiked(volts: np.ndarray, at: np.ndarray, last: float, rate_hz: float) -> np.ndarray:
    return np.where(at % SPIKE_EVERY == 0, SPIKE_V, volts)


def humming(volts: np.ndarray, at: np.ndarray, last: float, rate_hz: float) -> np.ndarray:
    return volts + HUM_V * np.sin(2.0 * math.pi * HUM_HZ * at / rate_hz)


def dropping_out(volts: np.ndarray, at: np.ndarray, last: float, rate_hz: float) -> np.ndarray:
    return np.where(at % round(DROPOUT_EVERY_S * rate_hz) < DROPOUT_S * rate_hz, 0.0, volts)


def drifting(volts: np.ndarray, at: np.ndarray, last: float, rate_hz: float) -> np.ndarray:
    return np.minimum(volts + DRIFT_V_S * at / rate_hz, RANGE_V)


SENSOR: dict[str, Spoil] = {
    "stuck": lambda volts, at, last, rate_hz: np.full(volts.size, last),
    "open": lambda volts, at, last, rate_hz: NOISE_V * noise(at),
    "over-range": lambda volts, at, last, rate_hz: np.full(volts.size, RANGE_V),
    "nan": lambda volts, at, last, rate_hz: np.full(volts.size, math.nan),
    "1e30": lambda volts, at, last, rate_hz: np.full(volts.size, 1e30),
    "spikes": spiked,
    "hum": humming,
    "drift": drifting,
    "x0.1": lambda volts, at, last, rate_hz: 0.1 * volts,
    "x10": lambda volts, at, last, rate_hz: np.clip(10.0 * volts, -RANGE_V, RANGE_V),
    "reversed": lambda volts, at, last, rate_hz: -volts,
    "x0.5": lambda volts, at, last, rate_hz: 0.5 * volts,
    "x2": lambda volts, at, last, rate_hz: np.clip(2.0 * volts, -RANGE_V, RANGE_V),
    "fading": lambda volts, at, last, rate_hz: FADING ** (at / rate_hz) * volts,
    "dropouts": dropping_out,
}

AMPLIFIER: dict[str, Spoil] = {
    "dead": lambda volts, at, last, rate_hz: np.zeros(volts.size),
    "x10": lambda volts, at, last, rate_hz: 10.0 * volts,
    "held": lambda volts, at, last, rate_hz: np.full(volts.size, last),
}
