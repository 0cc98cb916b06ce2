"""A structure with known modes under blows of a hammer: exact motion by superposition of modes, sampled behind a filter.

A half-sine pulse is not band-limited. Force and motion are therefore computed at a multiple of the sample rate and pass the
same linear-phase filter before samples are taken, as in a data acquisition system.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import firwin, resample_poly

from identification import Channel

CHANNELS = (Channel("hammer", "force", "N"), Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
FREQUENCY_HZ = np.array([40.0, 95.0, 210.0])
DAMPING = np.array([0.004, 0.01, 0.007])
SHAPES = np.array([[0.9, 0.7, 1.2], [1.3, -0.4, 0.5]])
FAR = (640.0, 0.005, np.array([1.0, 0.8]))
RATE_HZ = 2048.0
OVER = 16
PULSE_S = 0.004
FILTER = firwin(2 * 24 * OVER + 1, 0.75 / OVER, window=("kaiser", 11.0))


def blow(time_s: np.ndarray, at_s: float, height_n: float, pulse_s: float = PULSE_S) -> np.ndarray:
    """float[3, n]: force and accelerations of a half-sine pulse on a structure at rest, in closed form."""
    t = time_s - at_s
    inside = (t >= 0.0) & (t < pulse_s)
    omega = np.pi / pulse_s
    force = np.where(inside, height_n * np.sin(omega * t), 0.0)
    modes = [(2 * np.pi * f, z, phi) for f, z, phi in zip(FREQUENCY_HZ, DAMPING, SHAPES.T, strict=True)]
    modes.append((2 * np.pi * FAR[0], FAR[1], FAR[2]))
    motion = np.zeros((2, time_s.size))
    until = np.clip(t, 0.0, pulse_s)
    for w, z, phi in modes:
        pole = -z * w + 1j * w * np.sqrt(1 - z**2)
        # integral of exp(pole (t - s)) sin(omega s) over s, by the two exponentials of the sine
        parts = [
            (np.exp(sign * 1j * omega * until + pole * (t - until)) - np.exp(pole * t)) / (sign * 1j * omega - pole)
            for sign in (1, -1)
        ]
        g = np.where(t > 0.0, height_n * (parts[0] - parts[1]) / 2j, 0.0)
        q, velocity = g.imag / pole.imag, (pole * g).imag / pole.imag
        motion += phi[:, None] * phi[0] * (force - 2 * z * w * velocity - w**2 * q)
    return np.vstack([force, motion])


def record(
    duration_s: float,
    hits: Sequence[tuple[float, float]],
    noise_db: float | None = None,
    seed: int = 0,
    rate_hz: float = RATE_HZ,
) -> np.ndarray:
    """float[3, n]: a record with blows (time, height), and noise that is so many dB below the RMS of every channel."""
    fine = np.arange(round(duration_s * rate_hz) * OVER) / (rate_hz * OVER)
    whole = sum((blow(fine, at, height) for at, height in hits), np.zeros((3, fine.size)))
    sampled = resample_poly(whole, 1, OVER, axis=1, window=FILTER)
    if noise_db is not None:
        random = np.random.default_rng(seed)
        rms = np.sqrt(np.mean(sampled**2, axis=1, keepdims=True)) * 10 ** (-noise_db / 20)
        sampled = sampled + rms * random.normal(size=sampled.shape)
    return sampled
