"""Filters and fractional delays of sensors and converters, as arrays for the kernels."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from simulators.sensing.parts import TAPS, Converter, Sensor

__all__ = [
    "channel_delays",
    "channel_sections",
    "dc_delay",
    "filter_delay",
    "lagrange_taps",
    "output_sections",
    "ring_size",
    "skew_taps",
]

Matrix = NDArray[np.float64]

_IDENTITY = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])


def low_pass_sections(order: int, corner_hz: float, rate_hz: float) -> Matrix:
    """Return a Butterworth low-pass as sections [n_section, 5] (b_0 b_1 b_2 a_1 a_2); none if the corner is 0.

    The bilinear transform is prewarped to the corner of the analogue filter. Below the corner the response is that of the
    analogue filter at a frequency that differs by less than ``(pi corner / rate)^2 / 3``: 0.5 % if the rate is 25 times the
    corner.
    """
    return np.zeros((0, 5)) if corner_hz == 0.0 else _butterworth(order, corner_hz, rate_hz).copy()


@lru_cache(maxsize=64)
def _butterworth(order: int, corner_hz: float, rate_hz: float) -> Matrix:
    """Design a filter, once for all channels and rigs that have it."""
    from scipy.signal import butter  # half a second, which a rig without filters need not wait for

    sections: Matrix = butter(order, corner_hz, fs=rate_hz, output="sos")
    return sections[:, [0, 1, 2, 4, 5]]


def channel_sections(sensors: Sequence[Sensor], converter: Converter) -> Matrix:
    """Return sections [n_section, 5, n_channel]: the anti-alias filter, then the low-passes of the sensors that have one."""
    rate_hz = converter.internal_rate_hz
    shared = low_pass_sections(converter.anti_alias_order, converter.anti_alias_hz, rate_hz)
    own = [low_pass_sections(1, sensor.low_pass_hz, rate_hz) for sensor in sensors]
    columns = [shared] * len(sensors)
    if any(section.size for section in own):
        columns = [np.vstack([shared, section if section.size else _IDENTITY]) for section in own]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


def output_sections(converter: Converter) -> Matrix:
    """Return the sections [n_section, 5, 1] of the reconstruction filter."""
    sections = low_pass_sections(
        converter.reconstruction_order, converter.reconstruction_hz, converter.internal_rate_hz
    )
    return np.ascontiguousarray(sections[..., np.newaxis])


def dc_delay(sections: Matrix) -> NDArray[np.float64]:
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
    internal = _anti_alias_delay(converter) + float(dc_delay(output_sections(converter))[0])
    return internal / converter.oversampling


def _anti_alias_delay(converter: Converter) -> float:
    sections = low_pass_sections(converter.anti_alias_order, converter.anti_alias_hz, converter.internal_rate_hz)
    return float(dc_delay(sections[..., np.newaxis])[0])


def lagrange_taps(delay: float) -> tuple[int, Matrix]:
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


def skew_taps(sensors: Sequence[Sensor], converter: Converter) -> tuple[list[int], Matrix]:
    """Return the whole delays and the weights [n_channel, TAPS] of all channels, at the internal rate."""
    taps = [lagrange_taps(sensor.skew_samples * converter.oversampling) for sensor in sensors]
    return [first for first, _ in taps], np.array([weights for _, weights in taps])


def ring_size(delays: NDArray[np.int64], taps: Matrix) -> int:
    """Return the length of the ring of past values: a power of two that holds every tap, or 0 if no channel is skewed."""
    if np.all(delays == 0) and np.all(taps[:, 1:] == 0.0):
        return 0
    return 1 << int(np.max(delays, initial=0) + taps.shape[1] - 1).bit_length()
