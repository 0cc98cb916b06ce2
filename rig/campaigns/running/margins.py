"""How close recorded points came to the limits of the bench and to the ranges of its sensors."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.tick.safety.layout import EndReason

LIMITS = {
    EndReason.FORCE_LIMIT: "force_n",
    EndReason.RESPONSE_LIMIT: "acceleration_m_s2",
    EndReason.DISPLACEMENT_LIMIT: "displacement_m",
    EndReason.OVERTRAVEL: "displacement_m",
}
"""The limit of the bench that a trip reason refers to."""

SAMPLES = 256  # of a period


class Margin(NamedTuple):
    """How close an earlier point came to the limit that later stopped the run."""

    level: float
    """Level of the point."""
    share: float
    """Peak over the allowed value; 1 at the limit."""
    key: str
    """Key or range of the bench that defines the limit."""


def margin_before(
    bench: Bench, reason: EndReason, channel: int, unit: str, points: Iterable[Point[object]]
) -> Margin | None:
    """Return the largest share of the tripped limit that points with levels in ``unit`` had reached.

    Returns None if the trip does not concern an amplitude of a channel, or if no point has harmonics.
    """
    key, allowed = _allowed(bench, reason, channel)
    known = [point for point in points if point.spectrum is not None and point.level_unit == unit]
    if not key or not known:
        return None
    shares = [(_peak(point, channel, reason) / allowed, point.level) for point in known]
    share, level = max(shares)
    return Margin(level, share, key)


def _allowed(bench: Bench, reason: EndReason, channel: int) -> tuple[str, float]:
    if channel < 0:
        return "", math.inf
    if reason in LIMITS:
        return f"limits.{LIMITS[reason]}", float(getattr(bench.limits, LIMITS[reason]))
    if reason is EndReason.SENSOR_OVERLOAD:
        one = bench.channels[channel]
        return f"the range of {one.range_in_unit:.4g} {one.unit}", one.range_in_unit
    return "", math.inf


def _peak(point: Point[object], channel: int, reason: EndReason) -> float:
    """Largest instantaneous value of a channel over a period, without its mean: of the signal, or of its displacement."""
    harmonics = spectrum_of(point).harmonics[channel, 1:]
    orders = np.arange(1, harmonics.size + 1)
    if LIMITS.get(reason) == "displacement_m":
        harmonics = -harmonics / (2.0 * math.pi * vibration_of(point).frequency_hz * orders) ** 2
    turns = 2j * math.pi * np.outer(np.arange(SAMPLES) / SAMPLES, orders)
    return float(np.abs((np.exp(turns) @ harmonics).real).max())
