"""Forecast of a run by a rehearsal, and comparison of the run with it, both as stored in the recording.

A forecast has, per point, the proportion accepted and the quantiles of what is measured.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import TypeAdapter

from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.stored_point import value_of

GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())  # probabilities of the quantiles that are forecast
QUANTITIES = ("frequency_hz", "force_n", "amplitude_m", "voltage_v", "damping_ratio")
"""Quantities of a point that a rehearsal evaluates."""
LIKELY = 0.95
"""Probability from which on it is a finding that something did not happen; chosen: the usual level of 95 %."""
TOLERANCE = 1e-3
"""Relative distance from all draws below which a value is no finding; chosen: the scatter of settled points."""


@dataclass(frozen=True)
class PointForecast:
    """Forecast of one point: level, probability that it is accepted, and quantiles (empty if few draws have a value)."""

    level: float
    accepted: float
    frequency_hz: tuple[float, ...] = ()
    force_n: tuple[float, ...] = ()
    amplitude_m: tuple[float, ...] = ()
    voltage_v: tuple[float, ...] = ()
    damping_ratio: tuple[float, ...] = ()


@dataclass(frozen=True)
class Forecast:
    """Forecast of a run, as a recording keeps it."""

    trips: float
    """Probability of a trip."""
    points: dict[str, PointForecast]
    """Points by their number, from 0."""
    duration_s: tuple[float, ...] = ()
    """Quantiles of the time on the rig, s."""


@dataclass(frozen=True)
class PointComparison:
    """One point of a run beside its forecast."""

    number: int
    """Number, from 0."""
    level: float
    """Level."""
    rank: Mapping[str, float]
    """Proportion of the draws below the measured value, by quantity."""
    findings: tuple[str, ...]
    """Where it lies outside all draws, one line each."""


@dataclass(frozen=True)
class Comparison:
    """A run beside its forecast."""

    points: tuple[PointComparison, ...]
    """Points that were measured or failed."""
    findings: tuple[str, ...]
    """Findings on the whole run and on its points, one line each."""


def read_forecast(stored: object) -> Forecast:
    """Return a forecast as a recording stores it; raise ValidationError for anything else."""
    return TypeAdapter(Forecast).validate_python(stored)


def compare(forecast: Forecast, points: Iterable[Point[object]], end: Mapping[str, object] | None) -> Comparison:
    """Compare points of a run, and how it ended, with a forecast.

    A value outside all draws, a point refused that nearly all draws accept, and a trip that nearly none has, are findings.
    """
    found = tuple(_point(forecast.points.get(str(point.number)), point) for point in points)
    findings = [f"point {one.number + 1}: {text}" for one in found for text in one.findings]
    if end is not None and end["tripped"] and forecast.trips <= 1.0 - LIKELY:
        findings.insert(
            0,
            f"the run tripped ({end['text']}); the forecast was a trip in {100.0 * forecast.trips:.2g} % of the draws",
        )
    return Comparison(found, tuple(findings))


def _point(forecast: PointForecast | None, point: Point[object]) -> PointComparison:
    rank: dict[str, float] = {}
    findings: list[str] = []
    if forecast is None:
        return PointComparison(point.number, point.level, rank, ("no draw came as far",))
    if not point.accepted:
        if forecast.accepted >= LIKELY:
            findings.append(f"refused ({point.reason}); {100.0 * forecast.accepted:.3g} % of the draws accept it")
        return PointComparison(point.number, point.level, rank, tuple(findings))
    for name in QUANTITIES:
        quantiles, value = getattr(forecast, name), value_of(point, name)
        if not quantiles or value is None or not math.isfinite(value):
            continue
        rank[name] = float(np.interp(value, quantiles, GRID))
        low, high = quantiles[0], quantiles[-1]
        if not low * (1.0 - TOLERANCE) <= value <= high * (1.0 + TOLERANCE):
            findings.append(f"{name} = {value:.5g}: outside all draws, {low:.5g} to {high:.5g}")
    return PointComparison(point.number, point.level, rank, tuple(findings))
