"""Convert a record to slowly varying amplitudes that preserve a linear equation of motion.

Any linear filter that is applied alike to force, acceleration, velocity and displacement preserves
``phi_d^2 F = a + c v + k x``. Two filters are applied here. One is a zero-phase high-pass below the fundamental, without
which an acceleration could not be integrated to velocity and displacement. The other is the window of the demodulation. Both
run over the whole record; slices are taken afterwards.
"""

from functools import cache

import numpy as np

from vibrolock.arrays import Complex, Float

WINDOW_PERIODS = 3.0
"""Length of the Blackman window: its zeros lie at all other multiples of the fundamental frequency, including zero."""
WINDOW_VARIANCE = 0.25 * WINDOW_PERIODS**2 * (0.28 - 1.92 / np.pi**2) / 0.84
"""Variance of the Blackman window as a distribution, periods^2."""

_STOP, _PASS = 0.25, 0.6  # edges of the high-pass over the fundamental frequency
_END_FIT_PERIODS = 3.0
"""Periods at each end of a record to which harmonics are fitted for its continuation. Chosen."""
_END_PERIODS = 12.0  # the filter rings for about 1 / (_PASS - _STOP) periods
_END_HARMONICS = 3
"""Highest harmonic of these fits. Chosen."""


def derivatives(theta: Float, data: Float, rate_hz: float, delay_s: Float, orders: tuple[int, ...]) -> Float:
    """float[n_signals, n]: signals differentiated ``orders[i]`` times (integrated if negative), with their delays removed.

    ``data`` float[n_signals, n]; ``delay_s`` float[n_signals]. All signals pass the same high-pass. The record is extended at
    both ends by its harmonics there, which fade to zero over some periods, so that the filter does not ring into the record.
    """
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    step = float(theta[-1] - theta[0]) / (theta.size - 1)
    fade = int(_END_PERIODS * 2.0 * np.pi / step)
    padded = np.zeros((data.shape[0], next_fast_len(theta.size + 2 * fade, real=True)))
    padded[:, fade : fade + theta.size] = data
    padded[:, :fade] = _ending(theta[::-1], data[:, ::-1], fade)[:, ::-1]
    padded[:, fade + theta.size : 2 * fade + theta.size] = _ending(theta, data, fade)
    omega = 2.0 * np.pi * rfftfreq(padded.shape[1], 1.0 / rate_hz)
    high_pass = _high_pass(omega / (step * rate_hz))
    rotation = 1j * np.where(omega > 0.0, omega, 1.0)
    spectra = rfft(padded, axis=1)
    for row, order in enumerate(orders):
        spectra[row] *= high_pass * rotation**order * np.exp(1j * omega * delay_s[row])
    return np.asarray(irfft(spectra, padded.shape[1], axis=1)[:, fade : fade + theta.size])


def _ending(theta: Float, data: Float, length: int) -> Float:
    """float[n_signals, length]: harmonics of the last few periods, continued beyond the record and faded by half a cosine."""
    last = np.abs(theta - theta[-1]) <= 2.0 * np.pi * _END_FIT_PERIODS
    orders = np.arange(_END_HARMONICS + 1)

    def columns(phase: Float) -> Float:
        turns = np.outer(phase, orders)
        return np.hstack([np.cos(turns), np.sin(turns[:, 1:])])

    step = (theta[last][-1] - theta[last][0]) / max(1, int(last.sum()) - 1)
    further = theta[-1] + step * np.arange(1, length + 1)
    found = np.linalg.lstsq(columns(theta[last]), data[:, last].T, rcond=None)[0]
    return np.asarray((columns(further) @ found).T * 0.5 * (1.0 + np.cos(np.pi * np.arange(1, length + 1) / length)))


def amplitudes(theta: Float, data: Float, at: Float, harmonics: int) -> Complex:
    """complex[n_signals, len(at), H + 1]: harmonics around the phases ``at``, with a Blackman window over the phase."""
    half = np.pi * WINDOW_PERIODS
    weight = np.gradient(theta)
    rotations = np.exp(-1j * np.outer(np.arange(harmonics + 1), theta))
    first, end = np.searchsorted(theta, at - half), np.searchsorted(theta, at + half)
    factor = np.full(harmonics + 1, 2.0)
    factor[0] = 1.0
    out = np.empty((data.shape[0], at.size, harmonics + 1), np.complex128)
    for number, centre in enumerate(at):
        part = slice(int(first[number]), int(end[number]))
        window = _blackman((theta[part] - centre) / half) * weight[part]
        out[:, number] = (data[:, part] * (window / window.sum())) @ rotations[:, part].T
    return np.asarray(out * factor)


def between_harmonics(theta: Float, signal: Float, at: Float) -> Float:
    """float[len(at)]: half the squared amplitude of ``signal`` (float[n]) between harmonics, at orders 1.5 and 2.5.

    It is measured through a window of twice the length, whose zeros lie at all harmonics, and scaled to the single window.
    """
    found = amplitudes(0.5 * theta, signal[None], 0.5 * at, 5)[0]
    return np.asarray(np.mean(np.abs(found[:, [3, 5]]) ** 2, axis=1))


def _blackman(place: Float) -> Float:
    return np.asarray(0.42 + 0.5 * np.cos(np.pi * place) + 0.08 * np.cos(2.0 * np.pi * place))


def window_correlations(distance_periods: Float) -> tuple[Complex, Complex]:
    """Return two correlations of noise at instants ``distance_periods`` apart (the first instant minus the second).

    The first is that of white noise filtered by the window. The second is that of white noise of an acceleration in
    ``a + w^2 x`` at resonance, where the noise cancels except for the factor ``1 - 1 / (1 + n)^2``; n is the distance of its
    frequency from the fundamental frequency, relative to the fundamental frequency.
    """
    lags, plain, motion = _correlations()
    return np.interp(distance_periods, lags, plain), np.interp(distance_periods, lags, motion)


@cache
def _correlations() -> tuple[Float, Complex, Complex]:
    """Return lags in periods, and both correlations there, computed from their spectra."""
    places = np.linspace(-1.0, 1.0, 241)
    orders = np.linspace(-0.75, 2.0, 551)  # the high-pass stops below, the window above
    turns = np.exp(-1j * np.pi * WINDOW_PERIODS * np.outer(orders, places))
    plain = np.abs(turns @ _blackman(places)) ** 2 * _high_pass(1.0 + orders) ** 2
    lags = np.linspace(-2.0, 2.0, 401) * WINDOW_PERIODS
    back = np.exp(2j * np.pi * np.outer(lags, orders))
    both = [back @ spectrum / spectrum.sum() for spectrum in (plain, plain * (1.0 - (1.0 + orders) ** -2.0) ** 2)]
    return lags, both[0], both[1]


def _high_pass(order: Float) -> Float:
    """Gain at frequencies relative to the fundamental frequency."""
    return np.asarray(np.sin(0.5 * np.pi * np.clip((order - _STOP) / (_PASS - _STOP), 0.0, 1.0)) ** 2)
