"""Comparison of a run with the forecast of its rehearsal, both as stored in the recording."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import TypeAdapter

from rig.campaigns.evaluation.point import Point
from rig.rehearsal.forecast import GRID, Forecast, PointForecast

LIKELY = 0.95
"""Probability from which on it is a finding that something did not happen; chosen: the usual level of 95 %."""
TOLERANCE = 1e-3
"""Relative distance from all draws below which a value is no finding; chosen: the scatter of settled points."""
_FORECAST = TypeAdapter(Forecast)


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
    return _FORECAST.validate_python(stored)


def compare(forecast: Forecast, points: Iterable[Point[object]], end: Mapping[str, object] | None) -> Comparison:
    """Compare points of a run, and how it ended, with a forecast.

    A value outside all draws, a point refused that nearly all draws accept, and a trip that nearly none has, are findings.
    """
    found = tuple(_point(forecast.points.get(str(point.number)), point) for point in points)
    findings = [f"point {one.number + 1}: {text}" for one in found for text in one.findings]
    if end is not None and end["tripped"] and forecast.trips <= 1.0 - LIKELY:
        findings.insert(
            0, f"the run tripped ({end['text']}); foreseen was a trip in {100.0 * forecast.trips:.2g} % of the draws"
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
    for name, value in _values(point).items():
        quantiles: tuple[float, ...] = getattr(forecast, name)
        if not quantiles or not math.isfinite(value):
            continue
        rank[name] = float(np.interp(value, quantiles, GRID))
        low, high = quantiles[0], quantiles[-1]
        if not low * (1.0 - TOLERANCE) <= value <= high * (1.0 + TOLERANCE):
            findings.append(f"{name} = {value:.5g}: outside all draws, {low:.5g} to {high:.5g}")
    return PointComparison(point.number, point.level, rank, tuple(findings))


def _values(point: Point[object]) -> dict[str, float]:
    out: dict[str, float] = {}
    if point.vibration is not None:
        for name in ("frequency_hz", "force_n", "amplitude_m", "voltage_v"):
            out[name] = getattr(point.vibration, name)
    if point.modal is not None and point.modal.damping_ratio is not None:
        out["damping_ratio"] = point.modal.damping_ratio
    return out
