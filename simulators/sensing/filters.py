"""Filters and fractional delays of sensors and converters, as arrays for the kernels."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulators.sensing.parts import TAPS, Converter, Sensor
from vibrolock.arrays import Float

_IDENTITY = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])  # a section that changes nothing


def low_pass_sections(order: int, corner_hz: float, rate_hz: float) -> Float:
    """Return a Butterworth low-pass as sections [n_section, 5] (b_0 b_1 b_2 a_1 a_2); none if the corner is 0.

    With the corner at 1 rad/s, the poles of order n lie on the unit circle at ``pi/(2n)``, ``3 pi/(2n)`` ... from the imaginary
    axis. A pair at angle ``t`` gives ``1/(s^2 + 2 sin(t) s + 1)``, the real pole of an odd order ``1/(s + 1)``; the sections
    become less damped from the first to the last. The bilinear transform ``s = (z - 1)/(z + 1)/k`` is prewarped to the corner,
    ``k = tan(pi corner / rate)`` (Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.1.2). Below the corner the
    response is that of the analogue filter at a frequency that differs by less than ``(pi corner / rate)^2 / 3``: 0.5 % if the
    rate is 25 times the corner.
    """
    if corner_hz == 0.0:
        return np.zeros((0, 5))
    k = math.tan(math.pi * corner_hz / rate_hz)
    sections = [[k / (1.0 + k), k / (1.0 + k), 0.0, (k - 1.0) / (k + 1.0), 0.0]] if order % 2 else []
    for pair in range(order // 2, 0, -1):
        damping = 2.0 * k * math.sin((2 * pair - 1) * math.pi / (2 * order))
        scale = 1.0 / (1.0 + damping + k * k)
        gain = k * k * scale
        sections.append([gain, 2.0 * gain, gain, 2.0 * (k * k - 1.0) * scale, (1.0 - damping + k * k) * scale])
    return np.array(sections)


def channel_sections(sensors: Sequence[Sensor], converter: Converter) -> Float:
    """Return sections [n_section, 5, n_channel]: the anti-alias filter, then the low-passes of the sensors that have one."""
    rate_hz = converter.internal_rate_hz
    shared = low_pass_sections(converter.anti_alias_order, converter.anti_alias_hz, rate_hz)
    own = [low_pass_sections(1, sensor.low_pass_hz, rate_hz) for sensor in sensors]
    columns = [shared] * len(sensors)
    if any(section.size for section in own):
        columns = [np.vstack([shared, section if section.size else _IDENTITY]) for section in own]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


def output_sections(converter: Converter) -> Float:
    """Return the sections [n_section, 5] of the reconstruction filter."""
    sections = low_pass_sections(
        converter.reconstruction_order, converter.reconstruction_hz, converter.internal_rate_hz
    )
    return np.ascontiguousarray(sections)


def dc_delay(sections: Float) -> NDArray[np.float64]:
    """Return the low-frequency group delay [n_channel] of sections [n_section, 5, n_channel], in samples at the filters' rate.

    For ``H = B/A`` it is ``sum k b_k / sum b_k - sum k a_k / sum a_k``, summed over the sections.
    """
    b_0, b_1, b_2, a_1, a_2 = np.moveaxis(sections, 1, 0)
    delays = (b_1 + 2.0 * b_2) / (b_0 + b_1 + b_2) - (a_1 + 2.0 * a_2) / (1.0 + a_1 + a_2)
    delay: NDArray[np.float64] = delays.sum(axis=0)
    return delay


def channel_delays(sensors: Sequence[Sensor], converter: Converter) -> NDArray[np.float64]:
    """Return the delay of each channel [n_channel] by its own low-pass and skew, in samples at low frequency."""
    all_filters, shared = dc_delay(channel_sections(sensors, converter)), _anti_alias_delay(converter)
    skews = np.array([sensor.skew_samples for sensor in sensors])
    own: NDArray[np.float64] = (all_filters - shared) / converter.oversampling + skews
    return own


def filter_delay(converter: Converter) -> float:
    """Return the delay of every channel by anti-alias and reconstruction filter, in samples at low frequency."""
    internal = _anti_alias_delay(converter) + float(dc_delay(output_sections(converter)[..., np.newaxis])[0])
    return internal / converter.oversampling


def _anti_alias_delay(converter: Converter) -> float:
    sections = low_pass_sections(converter.anti_alias_order, converter.anti_alias_hz, converter.internal_rate_hz)
    return float(dc_delay(sections[..., np.newaxis])[0])


def lagrange_taps(delay: float) -> tuple[int, Float]:
    """Return the whole delay of the first tap, and the weights [TAPS] that interpolate ``delay`` (at least 0) samples back.

    Lagrange's polynomial passes through six values, three on either side of the wanted instant where there are so many. The
    relative error of a sine of ``w`` rad per sample is up to ``0.024 w^6``, or ``0.005 w^6`` from a delay of two samples on.
    """
    first = max(0, int(delay) - (TAPS // 2 - 1))
    nodes = np.arange(first, first + TAPS)
    weights = np.ones(TAPS)
    for k in range(TAPS):
        others = np.delete(nodes, k)
        weights[k] = np.prod((delay - others) / (nodes[k] - others))
    return first, weights


def skew_taps(sensors: Sequence[Sensor], converter: Converter) -> tuple[list[int], Float]:
    """Return the whole delays and the weights [n_channel, TAPS] of all channels, at the internal rate."""
    taps = [lagrange_taps(sensor.skew_samples * converter.oversampling) for sensor in sensors]
    return [first for first, _ in taps], np.array([weights for _, weights in taps])


def ring_size(delays: NDArray[np.int64], taps: Float) -> int:
    """Return the length of the ring of past values: a power of two that holds every tap, or 0 if no channel is skewed."""
    if np.all(delays == 0) and np.all(taps[:, 1:] == 0.0):
        return 0
    return 1 << int(np.max(delays, initial=0) + taps.shape[1] - 1).bit_length()
