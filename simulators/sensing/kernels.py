"""Compiled sensors and converters: from SI values to the volts that a converter reads, and back.

Noise is drawn by counter: a sample's noise is a function of seed, channel and sample index alone, so that a run gives
the same samples however it is cut into blocks, and adding a channel leaves the noise of the others as it was.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DIVERGED, SENSOR_CLIPPED
from vibrolock.compiled import Record, kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _32 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)
_UNIT = 2.0**-32


@kernel
def mix(value: np.uint64) -> np.uint64:
    """A well-mixed 64-bit hash: the output function of SplitMix64 (Steele, Lea & Flood 2014)."""
    value = (value ^ (value >> _30)) * _MIX_1
    value = (value ^ (value >> _27)) * _MIX_2
    return value ^ (value >> _31)


@kernel
def normal_pair(key: np.uint64, sample: int) -> tuple[float, float]:
    """Two independent standard normal numbers for one key and sample index (Box & Muller 1958), at most 6.7 in size."""
    bits = mix(key + np.uint64(sample) * _GOLDEN)
    radius = math.sqrt(-2.0 * math.log((float(bits >> _32) + 0.5) * _UNIT))
    angle = 2.0 * math.pi * _UNIT * float(bits & _LOW)
    return radius * math.cos(angle), radius * math.sin(angle)


@kernel
def quantise(volts: float, step_v: float, range_v: float) -> float:
    """The nearest code of a two's-complement converter, in volts, within ``[-range, range - step]``."""
    if step_v > 0.0:
        volts = step_v * np.rint(volts / step_v)
    return min(max(volts, -range_v), range_v - step_v)


@kernel
def read_channel(channel: Record, converter: Record, value: float) -> tuple[float, bool]:
    """Volts of one channel for a sensed value (SI), and whether sensor or converter are at their limit."""
    sensed = value * channel.sensitivity
    volts = min(max(sensed, -channel.range_v), channel.range_v)
    clipped = volts != sensed or abs(volts) > converter.adc_range_v
    return quantise(volts, converter.adc_step_v, converter.adc_range_v), clipped


@kernel
def measure(
    channels: NDArray[Any],
    converters: NDArray[Any],
    noise_keys: NDArray[np.uint64],
    filters: NDArray[np.float64],
    values: NDArray[np.float64],
    sample: int,
    out_v: NDArray[np.float64],
) -> int:
    """Volts of every channel for the SI ``values`` at a sample index; returns SENSOR_CLIPPED, DIVERGED or 0.

    Each sensor is AC-coupled: a first-order high-pass, exact for values that change linearly between samples. Two
    neighbouring channels share a pair of random numbers.
    """
    flags = 0
    second = 0.0
    for c in range(channels.size):
        channel = channels[c]
        value = values[c]
        if not math.isfinite(value):
            flags |= DIVERGED
        low = channel.hold * filters[0, c] + channel.old * filters[1, c] + channel.new * value
        filters[0, c] = low
        filters[1, c] = value
        noise = second
        if c % 2 == 0:
            noise, second = normal_pair(noise_keys[c // 2], sample)
        out_v[c], clipped = read_channel(channel, converters[0], value - low + channel.noise_rms * noise)
        if clipped:
            flags |= SENSOR_CLIPPED
    if flags & DIVERGED:
        for c in range(channels.size):
            out_v[c] = math.nan
        return DIVERGED
    return flags
