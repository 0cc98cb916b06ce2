"""How near recorded points have come to the limits of the bench, and to the ends of its sensors' ranges."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.tick.safety.layout import EndReason

__all__ = ["Margin", "margin_before"]

LIMITS = {
    EndReason.FORCE_LIMIT: "force_n",
    EndReason.RESPONSE_LIMIT: "acceleration_m_s2",
    EndReason.DISPLACEMENT_LIMIT: "displacement_m",
    EndReason.OVERTRAVEL: "displacement_m",
}
"""Which of the bench's limits a reason is about."""

SAMPLES = 256  # of a period


class Margin(NamedTuple):
    """What a point had reached of what stopped the run later."""

    level: float
    """Its level."""
    share: float
    """Peak over what is allowed, 1 at the limit."""
    key: str
    """Key of the bench that allows it."""


def margin_before(
    bench: Bench, reason: EndReason, channel: int, unit: str, points: Iterable[Point[Any]]
) -> Margin | None:
    """The highest share that points with levels in ``unit`` had reached of what a trip is about.

    None where the reason is about no amplitude of a channel, or no point holds harmonics.
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


def _peak(point: Point[Any], channel: int, reason: EndReason) -> float:
    """Largest instantaneous value of a channel over a period, without its mean; of an acceleration or its displacement."""
    harmonics = spectrum_of(point).harmonics[channel, 1:]
    orders = np.arange(1, harmonics.size + 1)
    if LIMITS.get(reason) == "displacement_m":
        harmonics = -harmonics / (2.0 * math.pi * vibration_of(point).frequency_hz * orders) ** 2
    turns = 2j * math.pi * np.outer(np.arange(SAMPLES) / SAMPLES, orders)
    return float(np.abs((np.exp(turns) @ harmonics).real).max())
