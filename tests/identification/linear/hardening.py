"""A hardening circuit under multisines, ``x'' + 2 z w x' + w^2 x + a x^3 = u``, integrated from rest with the signal exact.

The signal is known at all instants, so that the classical Runge-Kutta method has its full order (compared with DOP853).
"""

import numpy as np
from scipy.optimize import least_squares

from identification import Channel, FrequencyResponseMatrix, PeriodicSpectra, best_linear_approximation

FREQUENCY_HZ, DAMPING = 70.0, 0.05
CUBIC = 6e13
LEVELS = (0.1, 1.0, 1.5, 2.2, 3.0)
"""RMS of the input; the frequency of the best linear approximation shifts by 0, 6, 11, 19 and 28 %."""
SAMPLES = 2048
LINES_HZ = np.arange(10.0, 201.0)
CHANNELS = (Channel("in", "force", "N"), Channel("out", "drive", "m"))


def inputs(level: float, realisations: int, seed: int) -> np.ndarray:
    """float[realisations, 2 SAMPLES]: one second of random-phase multisines on every hertz of the band."""
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, (realisations, LINES_HZ.size))
    spectrum = np.zeros((realisations, SAMPLES + 1), dtype=complex)
    spectrum[:, LINES_HZ.astype(int)] = SAMPLES * level * np.sqrt(2.0 / LINES_HZ.size) * np.exp(1j * phases)
    return np.fft.irfft(spectrum, 2 * SAMPLES, axis=1)


def outputs(u: np.ndarray, cubic: float = CUBIC, periods: int = 2) -> np.ndarray:
    """float[realisations, SAMPLES]: the last period of the output."""
    w, h = 2 * np.pi * FREQUENCY_HZ, 1.0 / SAMPLES
    x, v = np.zeros(u.shape[0]), np.zeros(u.shape[0])
    kept = np.empty((u.shape[0], SAMPLES))

    def slope(x: np.ndarray, v: np.ndarray, now: np.ndarray) -> np.ndarray:
        return now - 2 * DAMPING * w * v - w**2 * x - cubic * x**3

    for n in range(periods * SAMPLES):
        i = n % SAMPLES
        kept[:, i] = x
        first, middle, last = u[:, 2 * i], u[:, 2 * i + 1], u[:, (2 * i + 2) % (2 * SAMPLES)]
        a1 = slope(x, v, first)
        v2, a2 = v + 0.5 * h * a1, slope(x + 0.5 * h * v, v + 0.5 * h * a1, middle)
        v3, a3 = v + 0.5 * h * a2, slope(x + 0.5 * h * v2, v + 0.5 * h * a2, middle)
        v4, a4 = v + h * a3, slope(x + h * v3, v + h * a3, last)
        x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return kept


def spectra(level: float, realisations: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """complex[realisations, n_lines]: peak spectra of input and output."""
    u = inputs(level, realisations, seed)
    lines = LINES_HZ.astype(int)
    return tuple(np.fft.rfft(y, axis=1)[:, lines] * (2.0 / SAMPLES) for y in (u[:, ::2], outputs(u)))


def measured(u: np.ndarray, x: np.ndarray, seed: int, periods: int = 2) -> FrequencyResponseMatrix:
    """The best linear approximation with noise 60 dB below the output."""
    random = np.random.default_rng(seed)
    noise = 1e-3 * np.sqrt(np.sum(np.abs(x) ** 2, axis=1).mean() / SAMPLES)
    shape = (x.shape[0], periods, x.shape[1])
    noisy = x[:, None] + noise * (random.normal(size=shape) + 1j * random.normal(size=shape))
    values = np.stack([np.broadcast_to(u[:, None], shape), noisy], axis=2)
    excited = np.ones(LINES_HZ.size, dtype=bool)
    return best_linear_approximation(PeriodicSpectra(CHANNELS, LINES_HZ, excited, values), estimator="H1")


def own_pole(u: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Frequency and damping ratio of the one mode that fits the mobility best, all lines alike, by scipy."""
    s = 2j * np.pi * LINES_HZ
    mobility = s * np.sum(x * np.conj(u), axis=0) / np.sum(np.abs(u) ** 2, axis=0)

    def misfit(p: np.ndarray) -> np.ndarray:
        w = 2 * np.pi * FREQUENCY_HZ * p[0]
        off = p[2] * s / (s**2 + 2 * p[1] * w * s + w**2) / np.abs(mobility).max() - mobility / np.abs(mobility).max()
        return np.concatenate([off.real, off.imag])

    found = least_squares(misfit, [1.1, 0.07, 1.0], x_scale="jac", xtol=1e-12).x
    return float(FREQUENCY_HZ * found[0]), float(found[1])
