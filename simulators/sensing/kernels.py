"""Compiled sensors and converters: from SI values to the volts that a converter reads, and back.

Noise is drawn by counter: a sample's noise is a function of seed, channel and sample index alone, so that a run gives
the same samples however it is cut into blocks, and adding a channel leaves the noise of the others as it was.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulators.layout import DIVERGED, SENSOR_CLIPPED, RigArrays, RigState
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
def read_channel(rig: RigArrays, channel: Record, value: float, noise: float) -> tuple[float, bool]:
    """Volts of one channel for a high-passed value (SI) and unit noise, and whether sensor or converter are at their limit."""
    converter = rig.converter[0]
    sensed = (value + channel.noise_rms * noise) * channel.sensitivity
    volts = min(max(sensed, -channel.range_v), channel.range_v)
    clipped = volts != sensed or abs(volts) > converter.adc_range_v
    return quantise(volts, converter.adc_step_v, converter.adc_range_v), clipped


@kernel
def measure(rig: RigArrays, state: RigState, out_v: NDArray[np.float64]) -> int:
    """Volts of every channel for the SI values in ``state.outputs``; returns SENSOR_CLIPPED, DIVERGED or 0.

    Each sensor is AC-coupled: a first-order high-pass, exact for values that change linearly between samples.
    """
    flags = 0
    n_channel = rig.channels.size
    sample = state.counter[0]
    second = 0.0
    for c in range(n_channel):
        value = state.outputs[c]
        if not math.isfinite(value):
            flags |= DIVERGED
        channel = rig.channels[c]
        low = channel.hold * state.filters[0, c] + channel.old * state.filters[1, c] + channel.new * value
        state.filters[0, c] = low
        state.filters[1, c] = value
        noise = second
        if c % 2 == 0 and (channel.noise_rms > 0.0 or (c + 1 < n_channel and rig.channels[c + 1].noise_rms > 0.0)):
            noise, second = normal_pair(rig.noise_keys[c // 2], sample)
        out_v[c], clipped = read_channel(rig, channel, value - low, noise)
        if clipped:
            flags |= SENSOR_CLIPPED
    if flags & DIVERGED:
        out_v[:n_channel] = math.nan
    return flags
