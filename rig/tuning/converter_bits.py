"""What the last bits of the converters do to the force, away from the frequency of the output.

A converter rounds: its error has the RMS q/sqrt(12) for a bit of q, and spreads over all frequencies up to half the sample
rate. At phase resonance the force per volt is a small part of what it is elsewhere, so that the error of the output is
amplified against the force that is controlled.
"""

import math
from typing import NamedTuple

import numpy as np

from identification import FrequencyResponseMatrix
from rig.bench import Bench
from rig.campaigns.evaluation.nonharmonic_force import HIGHEST_ORDER
from vibrolock.arrays import Float


def rounding(bit: float, noise_rms: float = 0.0) -> float:
    """Return the RMS of the part of a rounding error that forms lines, for a bit and the noise in front of the converter.

    Without noise it is all of the error, ``q/sqrt(12)``. Noise turns the lines into noise: their amplitude falls at least as
    ``exp(-2 pi^2 (sigma/q)^2)`` (Widrow and Kollar, 2008, Quantization Noise).
    """
    return bit / math.sqrt(12.0) * math.exp(-2.0 * (math.pi * noise_rms / bit) ** 2)


class OutputBits(NamedTuple):
    """RMS of the force that rounding in the output converter causes where lines count, N."""

    plain_n: float
    """As it is."""
    shaped_n: float
    """With its error fed back (`rig.tick.kernels.with_shaped_rounding`)."""


def output_bits(bench: Bench, responses: FrequencyResponseMatrix, beyond_n: float) -> OutputBits:
    """Return the force that rounding in the output converter causes.

    Within the measured band it follows from the force per volt. Beyond the band, up to `HIGHEST_ORDER` times the mode's
    frequency where the error is fed back, it is at most what the multisine, which is rounded alike, has shown there
    (``beyond_n``, N), and at most what the largest force per volt of the band would give.
    """
    frequency, size = responses.frequency_hz, np.abs(responses.value[:, 0, 0])
    error, half_rate = rounding(bench.output_bit_v), 0.5 * bench.sample_rate_hz
    highest = min(HIGHEST_ORDER * bench.specimen.linear_frequency_hz, half_rate)

    def shaping(at_hz: Float) -> Float:
        return 2.0 * np.sin(0.5 * np.pi * at_hz / half_rate)

    def outside_n(width_hz: float) -> float:
        return error * float(size.max()) * math.sqrt(max(width_hz, 0.0) / half_rate)

    def inside_n(shape: Float) -> float:
        return error * math.sqrt(float(np.trapezoid((shape * size) ** 2, frequency)) / half_rate)

    first, last = float(frequency[0]), float(frequency[-1])
    plain_n = math.hypot(inside_n(np.ones(size.size)), min(outside_n(half_rate - (last - first)), beyond_n))
    above = shaping(np.linspace(last, max(highest, last), 100))
    part = math.sqrt(max(highest - last, 0.0) / (half_rate - last)) if half_rate > last else 0.0
    beyond_shaped_n = math.sqrt(float(np.mean(above**2))) * min(outside_n(highest - last), part * beyond_n)
    return OutputBits(plain_n, math.hypot(inside_n(shaping(frequency)), beyond_shaped_n))


def periodic_beyond(values: Float, period_samples: int, highest_line: float) -> float:
    """Return the RMS of the periodic part of a record of two or more periods above a line, without what noise has there.

    ``highest_line`` is in multiples of the resolution. Lines of the record between those of one period show noise alone.
    """
    periods = values.size // period_samples
    values = np.asarray(values[: periods * period_samples], float)
    values = np.where(np.isfinite(values), values, np.nanmean(values))
    power = 2.0 * np.abs(np.fft.rfft(values - values.mean())) ** 2 / values.size**2
    order = np.arange(power.size)
    above = order > periods * (highest_line + 0.5)
    lines = order % periods == 0
    noise = float(power[above & ~lines].sum()) / max(periods - 1, 1)
    return math.sqrt(max(float(power[above & lines].sum()) - noise, 0.0))
