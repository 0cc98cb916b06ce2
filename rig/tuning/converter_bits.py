"""What the last bits of the converters do to the force, away from the frequency of the output.

A converter rounds: its error has the RMS q/sqrt(12) for a bit of q, and spreads over all frequencies up to half the sample
rate. At phase resonance the force per volt is a small part of what it is elsewhere, so that the error of the output is
amplified against the force that is controlled.
"""

import math

import numpy as np

from identification import FrequencyResponseMatrix
from rig.bench import Bench
from vibrolock.arrays import Float


def rounding(bit: float, noise_rms: float = 0.0) -> float:
    """Return the RMS of the part of a rounding error that forms lines, for a bit and the noise in front of the converter.

    Without noise it is all of the error, ``q/sqrt(12)``. Noise turns the lines into noise: their amplitude falls at least as
    ``exp(-2 pi^2 (sigma/q)^2)`` (Widrow and Kollar, 2008, Quantization Noise).
    """
    return bit / math.sqrt(12.0) * math.exp(-2.0 * (math.pi * noise_rms / bit) ** 2)


def bits_force_n(bench: Bench, responses: FrequencyResponseMatrix, beyond_n: float) -> float:
    """Return the RMS of the force (N) that rounding in the output converter causes.

    Within the measured band it follows from the force per volt. Beyond the band it is at most what the multisine, which is
    rounded alike, has shown there (``beyond_n``, N), and at most what the largest force per volt of the band would give.
    """
    frequency, size = responses.frequency_hz, np.abs(responses.value[:, 0, 0])
    error, half_rate = rounding(bench.output_bit_v), 0.5 * bench.sample_rate_hz
    inside = error * math.sqrt(float(np.trapezoid(size**2, frequency)) / half_rate)
    width = max(half_rate - float(frequency[-1] - frequency[0]), 0.0)
    outside = error * float(size.max()) * math.sqrt(width / half_rate)
    return math.hypot(inside, min(outside, beyond_n))


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
