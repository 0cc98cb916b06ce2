"""Force window and exponential window of a hammer test.

The force window is 1 around the pulse and 0 elsewhere, so that the noise between hits does not count. The exponential window
``exp(-a t)`` over force *and* motions makes a long ring-down end within the record. The quotient of both transforms is then the
transfer function at ``s = a + i w`` instead of ``i w``, exactly, if the structure was at rest before and the motion has died
away at the end: ``L{exp(-a t) y}(i w) = Y(a + i w)``. A model that is evaluated there has the damping of the structure alone.
"""

import numpy as np

from identification.hammer.hits import Pulse
from vibrolock.arrays import Float

_BEFORE, _AFTER = 1.0, 4.0
"""Length of the force window before and after the pulse, in widths of the pulse; a filter's ringing belongs to the pulse."""
_LEFT = 1e-5
"""Amplitude that is left at the end of a record, relative to the beginning, from which it counts as ended."""
_PARTS = 20
"""Parts of a record; the energies of the first and of the last one show its decay. Chosen."""


def force_window(samples: int, pulse: Pulse, length: int | None = None) -> Float:
    """float[samples]: 1 around the pulse, with half a cosine of a pulse's width at either end.

    ``length`` is the number of samples from the beginning of the pulse to the end of the window; 5 widths if None.
    """
    width = max(pulse.width, 4)
    begin = pulse.first - int(_BEFORE * width)
    end = pulse.end + int(_AFTER * width) if length is None else pulse.first + max(length, pulse.width)
    at = np.arange(samples)
    up = np.clip((at - begin + 1) / max(pulse.first - begin, 1), 0.0, 1.0)
    down = np.clip((end - at) / width, 0.0, 1.0)
    return np.asarray(0.25 * (1.0 - np.cos(np.pi * up)) * (1.0 - np.cos(np.pi * down)))


def exponential_window(samples: int, rate_1_s: float, sample_rate_hz: float) -> Float:
    """float[samples]: ``exp(-rate t)`` from the first sample on."""
    return np.asarray(np.exp(-rate_1_s * np.arange(samples) / sample_rate_hz))


def decay_rate(motions: Float, noise_rms: Float, sample_rate_hz: float) -> float:
    """Return the rate of the exponential window that lets float[n_hits, n_channels, n] end within the record, 1/s.

    The motion, less its noise float[n_channels], is left to `_LEFT` of its beginning, by its own decay and the window. 0 if its
    own decay suffices.
    """
    part = max(motions.shape[-1] // _PARTS, 1)
    power = np.array([np.mean(motions[..., :part] ** 2, axis=-1), np.mean(motions[..., -part:] ** 2, axis=-1)])
    begin, end = np.maximum(np.mean(power, axis=1) - noise_rms**2, 0.0)
    left = float(np.max(np.sqrt(end / np.maximum(begin, 1e-300))))
    duration_s = motions.shape[-1] / sample_rate_hz
    return float(max(np.log(max(left, 1e-300) / _LEFT) / duration_s, 0.0))
