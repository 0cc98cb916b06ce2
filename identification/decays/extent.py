"""Where a free decay begins, and where it ends in noise."""

from collections.abc import Sequence

import numpy as np

from identification.decays.demodulation import POINTS_PER_WINDOW
from identification.errors import IdentificationError
from vibrolock.arrays import Float

FLOOR = 4.0
"""Amplitude over the RMS of the noise in it at which a decay ends; below, its logarithm is no longer unbiased."""
_WITHIN = 0.05  # of the largest amplitude: there the decay has not begun
_ENVELOPE_PERIODS = 3.0
"""Width, in periods, over which an envelope is the largest value. Chosen."""
_FORCE_NOISE, _FORCE_SHARE = 6.0, 0.02
"""A force is there above this multiple of its noise, and above this share of its largest value. Chosen."""
_LATEST_PERIODS = 10.0
"""Periods after the largest motion within which the force may end. Chosen."""
_QUIET_SHARE = 10
"""The last one in so many samples of the force is taken for its noise. Chosen."""
_SMOOTHING_WINDOWS = 8
"""Width of the smoothing in windows of the demodulation. Chosen."""
_NUMERIC = 1e-7  # of the largest amplitude: there digits end


def beginning_s(
    data: Float, motions: Sequence[int], force: int | None, rate_hz: float, start_s: float | None
) -> tuple[float, bool]:
    """Return where the free decay begins, s, and whether that is certain (given, or the end of the force).

    ``data`` float[n_channels, n]. Without a force, or where the force goes on because an exciter hangs on the structure, the
    decay begins where the vibration is for the last time within 5 % of its largest amplitude.
    """
    length_s = data.shape[1] / rate_hz
    if start_s is not None:
        if not 0.0 <= start_s < length_s:
            raise IdentificationError(f"the record goes from 0 to {length_s:.4g} s", field="start_s", value=start_s)
        return start_s, True
    moving = data[list(motions)]
    if not np.any(moving.std(axis=1) > 0.0):
        raise IdentificationError("no motion channel moves, there is no decay", field="samples")
    period_s = 1.0 / _strongest_hz(moving, rate_hz)
    by_motion = _last_large(moving, rate_hz, period_s)
    by_force = None if force is None else _force_end(data[force], rate_hz)
    if by_force is not None and by_force <= by_motion + _LATEST_PERIODS * period_s:
        return by_force, True
    return by_motion, False


def _strongest_hz(moving: Float, rate_hz: float) -> float:
    """Frequency of the largest line of all channels, each relative to its own largest."""
    spectra = np.abs(np.fft.rfft(moving - moving.mean(axis=1, keepdims=True), axis=1))
    spectra[:, :3] = 0.0
    largest = spectra.max(axis=1, keepdims=True)
    line = int(np.argmax(np.max(spectra / np.where(largest > 0.0, largest, 1.0), axis=0)))
    return float(max(line, 3) * rate_hz / moving.shape[1])


def _last_large(moving: Float, rate_hz: float, period_s: float) -> float:
    from scipy.ndimage import uniform_filter1d

    width = max(1, round(_ENVELOPE_PERIODS * period_s * rate_hz))
    still = moving - np.median(moving, axis=1, keepdims=True)
    variance = still.var(axis=1, keepdims=True)
    power = np.sum(still**2 / np.where(variance > 0.0, variance, 1.0), axis=0)
    envelope = np.sqrt(np.maximum(uniform_filter1d(power, width, mode="reflect"), 0.0))
    return float(np.flatnonzero(envelope >= (1.0 - _WITHIN) * envelope.max())[-1] / rate_hz)


def _force_end(force: Float, rate_hz: float) -> float | None:
    """Return the instant after which the force is no more than noise; None if it never was more, or does not end."""
    still = force - np.median(force)
    quiet = max(8, force.size // _QUIET_SHARE)
    blocks = still[: still.size // quiet * quiet].reshape(-1, quiet)
    noise = float(blocks.std(axis=1).min())
    size = np.abs(still)
    large = np.flatnonzero(size > max(_FORCE_NOISE * noise, _FORCE_SHARE * float(size.max())))
    return None if not large.size else float((large[-1] + 1) / rate_hz)


def reached_floor(size: Float, noise: float) -> int:
    """Number of instants, of ``size`` float[n], before the amplitude comes down to `FLOOR` times the noise (RMS)."""
    from scipy.ndimage import median_filter

    width = _SMOOTHING_WINDOWS * POINTS_PER_WINDOW + 1
    smooth = median_filter(size, min(width, size.size), mode="nearest")
    below = np.flatnonzero(smooth < FLOOR * max(noise, _NUMERIC * float(size.max())))
    return int(below[0]) if below.size else int(size.size)


def fallen(size: Float) -> int:
    """Number of instants before the amplitude, of ``size`` float[n], begins to fall for good."""
    large = np.flatnonzero(size >= (1.0 - _WITHIN) * size.max())
    return int(large[-1])
