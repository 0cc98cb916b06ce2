"""Vibrations of one mode written down in closed form: amplitude and phase are chosen, the force follows from them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification import Channel
from vibrolock.arrays import Float

RATE_HZ = 5000.0
PHI = 0.9
CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
TIP = 2.5  # deflection of the tip over that of the drive point
W0 = 2.0 * np.pi * 25.0


def modal_rad_s(size_m: Float) -> Float:
    """Modal frequency of a mode that stiffens by 4 % up to 2 mm."""
    return W0 * (1.0 + 0.04 * (np.asarray(size_m) / 2e-3) ** 2)


def damping_ratio(size_m: Float) -> Float:
    return 0.004 + 0.0005 * np.asarray(size_m) / 2e-3


@dataclass(frozen=True)
class Ramp:
    """A record of RATE_HZ, and the displacement's true amplitude."""

    theta: Float
    samples: Float
    size_m: Float


def ramp(
    log_size: Callable[[Float], Float],
    duration_s: float,
    *,
    wobble_hz: float = 0.0,
    excess: float = 0.0,
    second_harmonic_n: float = 0.0,
    noise: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
    linear: bool = False,
) -> Ramp:
    """Vibration with ``ln X(t)`` given, at its modal frequency plus a slow wobble.

    ``excess``: damping above the curve, relative. ``noise``: RMS of force (N) and accelerations (m/s2).
    """
    t = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    fine = 1e-4
    size = np.exp(log_size(t))
    growth = (log_size(t + fine) - log_size(t - fine)) / (2.0 * fine)
    bend = (log_size(t + fine) - 2.0 * log_size(t) + log_size(t - fine)) / fine**2
    w = modal_rad_s(0.0 * size if linear else size)
    zeta = damping_ratio(0.0 * size if linear else size) * (1.0 + excess)
    speed = w + 2.0 * np.pi * wobble_hz * np.sin(2.0 * np.pi * 0.7 * t)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / RATE_HZ])
    change = np.gradient(speed, 1.0 / RATE_HZ)
    rate = growth + 1j * speed
    x = size * np.exp(1j * theta)
    v, a = rate * x, (rate**2 + bend + 1j * change) * x
    force = ((a + 2.0 * zeta * w * v + w**2 * x) / PHI**2).real + second_harmonic_n * np.cos(2.0 * theta + 0.3)
    rng = np.random.default_rng(seed)
    samples = np.array([force, a.real, TIP * a.real])
    samples += np.array([noise[0], noise[1], noise[1]])[:, None] * rng.standard_normal(samples.shape)
    return Ramp(theta, samples, size)


def half_cosine(low_m: float, high_m: float, duration_s: float) -> Callable[[Float], Float]:
    """``ln X`` from one amplitude to another, over all of the record."""
    step = np.log(high_m / low_m)

    def log_size(t: Float) -> Float:
        return np.asarray(np.log(low_m) + step * 0.5 * (1.0 - np.cos(np.pi * np.clip(t / duration_s, 0.0, 1.0))))

    return log_size
