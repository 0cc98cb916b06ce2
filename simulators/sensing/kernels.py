"""Compiled sensors and converters: from SI values to the volts that a converter reads, and back.

Sensors and filters run at the internal rate, ``oversampling`` times the rate of the converter; one in ``oversampling`` instants
is converted. Noise is drawn by counter (`simulators.sensing.noise`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DAC_CLIPPED, SENSOR_CLIPPED
from simulators.products import combine
from simulators.sensing.noise.kernels import normal
from vibrolock.compiled import Record, inner_kernel, kernel
from vibrolock.lanes import differ, greatest, least, load, spread, store
from vibrolock.width import WIDTH


@kernel
def quantise(volts: float, step_v: float, range_v: float) -> float:
    """Return the nearest code of a two's-complement converter, in volts, within ``[-range, range - step]``."""
    if step_v > 0.0:
        volts = step_v * np.rint(volts / step_v)
    return min(max(volts, -range_v), range_v - step_v)


@kernel
def filter_output(sections: NDArray[np.float64], memory: NDArray[np.float64], volts: float) -> float:
    """Filter a voltage by second-order sections ``[n_section, 5]``: b_0 b_1 b_2 a_1 a_2.

    Transposed direct form II, with ``memory`` [n_section, 2].
    """
    for s in range(sections.shape[0]):
        y = sections[s, 0] * volts + memory[s, 0]
        memory[s, 0] = (sections[s, 1] * volts - sections[s, 3] * y) + memory[s, 1]
        memory[s, 1] = sections[s, 2] * volts - sections[s, 4] * y
        volts = y
    return volts


@inner_kernel
def sense(columns: NDArray[np.float64], weights: NDArray[np.float64], values: NDArray[np.float64]) -> bool:
    """Compute the sensed quantities (SI) ``values = sum_j weights[j] columns[j]``; return False if one is not finite."""
    combine(columns, weights, values)
    finite = True
    for c in range(0, columns.shape[1], WIDTH):
        sensed = load(values, c)
        finite &= not differ(sensed - sensed, spread(0.0))  # inf - inf is not a number either
    return finite


@inner_kernel
def condition(
    coefficients: NDArray[np.float64],
    filters: NDArray[np.float64],
    sections: NDArray[np.float64],
    memory: NDArray[np.float64],
    values: NDArray[np.float64],
) -> int:
    """Turn sensed ``values`` [n_padded] (SI) into volts in place, as they reach the converter; return SENSOR_CLIPPED or 0.

    ``coefficients`` [5, n_padded] are those of `simulators.layout.RigArrays`. Each sensor is AC-coupled by a first-order
    high-pass, exact for values that change linearly between internal instants; ``filters`` [2, n_padded] holds its low-passed
    and its last value. Where there are filters, volts are clipped at the sensor's range and then filtered by second-order
    sections ``[n_section, 5, n_padded]`` (b_0 b_1 b_2 a_1 a_2) in transposed direct form II, with ``memory``
    [n_section, 2, n_padded].
    """
    n, n_section = filters.shape[1], sections.shape[0]
    flags = 0
    for c in range(0, n, WIDTH):
        value = load(values, c)
        held, old = load(coefficients, c) * load(filters, c), load(coefficients, n + c) * load(filters, n + c)
        low = held + old + load(coefficients, 2 * n + c) * value
        store(filters, c, low)
        store(filters, n + c, value)
        x = (value - low) * load(coefficients, 3 * n + c)
        if n_section > 0:
            highest = load(coefficients, 4 * n + c)
            clipped = least(greatest(x, spread(0.0) - highest), highest)
            if differ(clipped, x):
                flags = SENSOR_CLIPPED
            x = clipped
        for s in range(n_section):
            at, state = 5 * n * s + c, 2 * n * s + c
            y = load(sections, at) * x + load(memory, state)
            first = load(sections, at + n) * x - load(sections, at + 3 * n) * y + load(memory, state + n)
            store(memory, state, first)
            store(memory, state + n, load(sections, at + 2 * n) * x - load(sections, at + 4 * n) * y)
            x = y
        store(values, c, x)
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
