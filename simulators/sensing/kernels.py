"""Compiled sensors and converters: from SI values to the volts that a converter reads, and back.

Sensors and filters run at the internal rate, ``oversampling`` times the rate of the converter; one in ``oversampling`` instants
is converted. Noise is drawn by counter (`simulators.sensing.noise`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DAC_CLIPPED, SENSOR_CLIPPED
from simulators.sensing.noise.kernels import normal
from vibrolock.compiled import Record, inner_kernel, kernel


@kernel
def quantise(volts: float, step_v: float, range_v: float) -> float:
    """Return the nearest code of a two's-complement converter, in volts, within ``[-range, range - step]``."""
    if step_v > 0.0:
        volts = step_v * np.rint(volts / step_v)
    return min(max(volts, -range_v), range_v - step_v)


@kernel
def filter_channels(sections: NDArray[np.float64], memory: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Filter ``values`` [n_channel] in place by second-order sections ``[n_section, 5, n_channel]``: b_0 b_1 b_2 a_1 a_2.

    Transposed direct form II, with ``memory`` [n_section, 2, n_channel]; the inner loop runs over the channels.
    """
    for s in range(sections.shape[0]):
        for c in range(sections.shape[2]):
            x = values[c]
            y = sections[s, 0, c] * x + memory[s, 0, c]
            memory[s, 0, c] = (sections[s, 1, c] * x - sections[s, 3, c] * y) + memory[s, 1, c]
            memory[s, 1, c] = sections[s, 2, c] * x - sections[s, 4, c] * y
            values[c] = y


@inner_kernel
def sense(columns: NDArray[np.float64], weights: NDArray[np.float64], values: NDArray[np.float64]) -> bool:
    """Compute the sensed quantities (SI) ``values = sum_j weights[j] columns[j]``; return False if one is not finite.

    Both lengths are multiples of four. The loop takes four channels and two columns at a time, so that the sums stay in
    registers.
    """
    finite = True
    for c in range(0, columns.shape[1], 4):
        a_0, a_1, a_2, a_3 = 0.0, 0.0, 0.0, 0.0
        b_0, b_1, b_2, b_3 = 0.0, 0.0, 0.0, 0.0
        for j in range(0, columns.shape[0], 2):
            a, b = weights[j], weights[j + 1]
            a_0 += a * columns[j, c]
            a_1 += a * columns[j, c + 1]
            a_2 += a * columns[j, c + 2]
            a_3 += a * columns[j, c + 3]
            b_0 += b * columns[j + 1, c]
            b_1 += b * columns[j + 1, c + 1]
            b_2 += b * columns[j + 1, c + 2]
            b_3 += b * columns[j + 1, c + 3]
        values[c], values[c + 1], values[c + 2], values[c + 3] = a_0 + b_0, a_1 + b_1, a_2 + b_2, a_3 + b_3
        finite &= math.isfinite((values[c] + values[c + 1]) + (values[c + 2] + values[c + 3]))
    return finite


@inner_kernel
def condition(channels: NDArray[Any], filters: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Turn sensed ``values`` [n_channel] (SI) into volts, in place.

    Each sensor is AC-coupled by a first-order high-pass, exact for values that change linearly between internal
    instants; ``filters`` [2, n_channel] holds its low-passed and its last value.
    """
    for c in range(channels.size):
        channel = channels[c]
        value = values[c]
        low = channel.hold * filters[0, c] + channel.old * filters[1, c] + channel.new * value
        filters[0, c] = low
        filters[1, c] = value
        values[c] = (value - low) * channel.sensitivity


@kernel
def anti_alias(
    channels: NDArray[Any], sections: NDArray[np.float64], memory: NDArray[np.float64], values: NDArray[np.float64]
) -> int:
    """Clip the conditioned volts at each sensor's range and filter them, in place; return SENSOR_CLIPPED or 0."""
    flags = 0
    for c in range(channels.size):
        range_v = channels[c].range_v
        if abs(values[c]) > range_v:
            flags = SENSOR_CLIPPED
            values[c] = min(max(values[c], -range_v), range_v)
    filter_channels(sections, memory, values)
    return flags


@kernel
def delay(
    channels: NDArray[Any],
    taps: NDArray[np.float64],
    history: NDArray[np.float64],
    instant: int,
    values: NDArray[np.float64],
) -> None:
    """Delay each channel's volts by its skew, with Lagrange interpolation between internal instants."""
    mask = history.shape[0] - 1
    for c in range(channels.size):
        first = instant - channels[c].delay
        volts = 0.0
        for k in range(taps.shape[1]):
            volts += taps[c, k] * history[(first - k) & mask, c]
        values[c] = volts


@inner_kernel
def convert(
    channels: NDArray[Any],
    converter: Record,
    noise_keys: NDArray[np.uint64],
    sample: int,
    values: NDArray[np.float64],
    out_v: NDArray[np.float64],
) -> int:
    """Convert the conditioned volts into ``out_v`` [n_channel].

    The noise of sensor and converter is added; then the sensor's range, and the converter's range and step, are applied. Return
    SENSOR_CLIPPED or 0.
    """
    step_v, range_v, codes_per_v = converter.adc_step_v, converter.adc_range_v, converter.adc_codes_per_v
    flags = 0
    for c in range(channels.size):
        channel = channels[c]
        sensed = values[c]
        if channel.noise_v > 0.0:
            sensed += channel.noise_v * normal(noise_keys[1 + c], sample)
        volts = min(max(sensed, -channel.range_v), channel.range_v)
        if volts != sensed or abs(volts) > range_v:
            flags = SENSOR_CLIPPED
        if step_v > 0.0:
            volts = step_v * np.rint(volts * codes_per_v)
        out_v[c] = min(max(volts, -range_v), range_v - step_v)
    return flags


@inner_kernel
def hold(converter: Record, noise_key: np.uint64, voltage: float, sample: int) -> tuple[float, int]:
    """Return the output of the digital-to-analogue converter for a voltage, including noise, and DAC_CLIPPED or 0."""
    flags = 0 if abs(voltage) <= converter.dac_range_v else DAC_CLIPPED
    held_v = 0.0 if math.isnan(voltage) else quantise(voltage, converter.dac_step_v, converter.dac_range_v)
    if converter.dac_noise_v > 0.0:
        held_v += converter.dac_noise_v * normal(noise_key, sample)
    return held_v, flags
