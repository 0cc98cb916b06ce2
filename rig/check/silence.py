"""Findings at 0 V: noise floor, offset, mains hum, channels that do not change or are at the end of their range."""

import math

import numpy as np

from rig.bench import Bench
from rig.check.findings import Finding, Verdict, graded
from rig.daq import Channel
from vibrolock.arrays import Float

MAINS_HZ = (50.0, 60.0)  # frequencies of the mains, Hz
HUM_HARMONICS = 3  # harmonics of the mains that are examined; chosen
MAX_NOISE = 3.0  # largest noise over the expected one; chosen
MIN_NOISE = 0.3  # least noise over the expected one, below which a sensor may be dead; chosen
MAX_OFFSET = 0.1  # largest offset over the range without a warning; chosen
MIN_SIGNIFICANCE = 5.0  # amplitude of a hum over the standard deviation of a line of noise; chosen


def silent_findings(bench: Bench, readings: Float) -> list[Finding]:
    """Return the findings from ``readings`` [n, n_channels] in SI units at 0 V."""
    out: list[Finding] = []
    for index, channel in enumerate(bench.channels):
        values = readings[:, index].astype(float)
        if not np.isfinite(values).all():
            text = "samples were lost or are not numbers; see the wire"
            out.append(Finding("samples", channel.name, "warn", text=text))
            values = values[np.isfinite(values)]
        stopping = bench.emergency_stop is not None and bench.emergency_stop.channel == channel.name
        if values.size < 10 or stopping:
            continue
        out += _of_channel(bench, channel, values)
    return out


def _of_channel(bench: Bench, channel: Channel, values: Float) -> list[Finding]:
    scale = abs(channel.sensitivity_v_per_unit)
    offset_v = float(values.mean()) * scale
    highest_v = bench.limits.overload_fraction * channel.range_v
    at_range = float(np.abs(values).max()) * scale >= highest_v
    largest_v = MAX_OFFSET * channel.range_v
    verdict = "fail" if at_range else graded(abs(offset_v), (0.0, largest_v), (0.0, highest_v))
    texts = {"ok": "", "warn": "see the sensor's supply and its warm-up"}
    text = texts.get(verdict, "at the end of its range: short or open?")
    offset = Finding("offset", channel.name, verdict, offset_v, "V", f"+-{largest_v:g}", text)
    return [offset, _noise(channel, values), *_hum(bench, channel, values)]


def expected_rms(channel: Channel) -> float:
    """RMS that the bench expects of a channel at rest, from its declared noise and the converter's steps, in its unit."""
    return math.hypot(channel.noise_rms, channel.resolution_in_unit / math.sqrt(12.0))


def _noise(channel: Channel, values: Float) -> Finding:
    bit, found, expected = channel.resolution_in_unit, float(values.std()), expected_rms(channel)
    verdict: Verdict = "warn"
    allowed = f"from {MIN_NOISE * expected:.3g}"
    if np.ptp(values) < 0.5 * bit and channel.noise_rms >= 0.5 * bit:
        text = "does not change at all: cable, supply or sensor may be dead"
    elif np.ptp(values) < 0.5 * bit:
        verdict, allowed = "ok", f"up to {MAX_NOISE * expected:.3g}"
        text = "below one bit, as the bench expects; whether it works is tested under drive"
    elif channel.noise_rms == 0.0 and found > MAX_NOISE * expected:
        verdict, allowed, text = "not tested", "", "the bench declares no noise_rms to compare with"
    elif found < MIN_NOISE * channel.noise_rms and channel.noise_rms > bit:
        text = "much quieter than the sensor can be: is it connected?"
    else:
        noisy, allowed = found > MAX_NOISE * expected, f"up to {MAX_NOISE * expected:.3g}"
        verdict = "warn" if noisy else "ok"
        text = "more than sensor and converter make: ambient vibration, cable or earth loop" if noisy else ""
    return Finding("noise", channel.name, verdict, found, channel.unit, allowed, text)


def _hum(bench: Bench, channel: Channel, values: Float) -> list[Finding]:
    found, at_hz = max((hum(values, mains, bench.sample_rate_hz), -mains) for mains in MAINS_HZ)
    allowed = expected_rms(channel)
    if found <= allowed:
        return []
    text = f"mains hum of {-at_hz:g} Hz and its harmonics: earth loop, or a cable beside the amplifier's"
    return [Finding("mains hum", channel.name, "warn", found, channel.unit, f"up to {allowed:.3g}", text)]


def hum(values: Float, mains_hz: float, sample_rate_hz: float) -> float:
    """RMS of the first three mains harmonics that stand out of the noise, by least squares over all samples; 0 if none does."""
    time = np.arange(values.size) / sample_rate_hz
    frequencies = [h * mains_hz for h in range(1, HUM_HARMONICS + 1) if h * mains_hz < 0.45 * sample_rate_hz]
    columns = [part(2.0 * math.pi * f * time) for f in frequencies for part in (np.cos, np.sin)]
    if not columns:
        return 0.0
    matrix = np.column_stack([np.ones_like(time), np.linspace(-0.5, 0.5, time.size), *columns])
    # The columns are nearly orthogonal: their products lose no digits that matter.
    found, *_ = np.linalg.lstsq(matrix.T @ matrix, matrix.T @ values)
    left = float(np.std(values - matrix @ found))
    amplitudes = np.hypot(found[2::2], found[3::2])
    loud = amplitudes > MIN_SIGNIFICANCE * left * math.sqrt(2.0 / values.size)
    return float(np.sqrt(0.5 * np.sum(amplitudes[loud] ** 2)))
