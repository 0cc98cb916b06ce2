"""Latency from a channel that the output itself is connected to."""

import math

import numpy as np

from rig.bench import Bench
from rig.check.findings import Finding
from rig.check.responses import Responses

__all__ = ["latency_findings"]

LATE_SAMPLES = 0.25


def latency_findings(bench: Bench, responses: Responses, lead_fraction: float) -> list[Finding]:
    """Delay of each loopback behind what the driver says; ``lead_fraction``: part of a sample that rows leave in it.

    The slope of its phase over the band, by least squares.
    """
    rows = [i for i, channel in enumerate(bench.channels) if channel.loopback]
    if not rows:
        text = "no channel is declared with loopback = true"
        return [Finding("latency", "", "not tested", text=text)]
    return [_slope(bench, responses, row, lead_fraction) for row in rows]


def _slope(bench: Bench, responses: Responses, row: int, lead_fraction: float) -> Finding:
    value, omega = responses.per_volt[row], 2.0 * math.pi * responses.frequency_hz / bench.sample_rate_hz
    phase = np.unwrap(np.angle(value))
    late = -float(np.polyfit(omega, phase, 1, w=np.abs(value))[0]) - lead_fraction
    bad = abs(late) > LATE_SAMPLES
    text = "more than the driver says: its queue or filter delay, or this channel's skew_samples" if bad else ""
    name = bench.channels[row].name
    return Finding("latency", name, "fail" if bad else "ok", late, "samples", f"+-{LATE_SAMPLES:g}", text)
