"""Where a run lies within what its rehearsal foresaw, both as stored in the recording."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.campaigns.evaluation.point import Point

LIKELY = 0.95  # probability from which on something that did not happen is a finding
GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())
"""Probabilities of the quantiles that are foreseen."""
TOLERANCE = 1e-3  # relative: what is outside the draws by less is no finding


@dataclass(frozen=True)
class PointComparison:
    """One point of a run beside what was foreseen."""

    number: int
    """Number, from 0."""
    level: float
    """Level."""
    rank: Mapping[str, float]
    """Share of the draws below the measured value, by quantity."""
    findings: tuple[str, ...]
    """Where it lies outside all draws, one line each."""


@dataclass(frozen=True)
class Comparison:
    """A run beside what was foreseen."""

    points: tuple[PointComparison, ...]
    """Points that were measured or failed."""
    findings: tuple[str, ...]
    """Findings on the whole run and on its points, one line each."""

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain data."""
        points = [
            {"number": p.number, "level": p.level, "rank": dict(p.rank), "findings": list(p.findings)}
            for p in self.points
        ]
        return {"points": points, "findings": list(self.findings)}


def compared(foreseen: Mapping[str, Any], points: Iterable[Point[object]], end: Mapping[str, Any] | None) -> Comparison:
    """Compare points of a run, and how it ended, with what was foreseen.

    A value outside all draws, a point refused that nearly all draws accept, and a trip that nearly none has, are findings.
    """
    found = tuple(_point(foreseen["points"].get(str(point.number)), point) for point in points)
    findings = [f"point {one.number + 1}: {text}" for one in found for text in one.findings]
    if end is not None and end["tripped"] and foreseen["trips"] <= 1.0 - LIKELY:
        findings.insert(
            0, f"the run tripped ({end['text']}); foreseen was a trip in {100.0 * foreseen['trips']:.2g} % of the draws"
        )
    return Comparison(found, tuple(findings))


def _point(foreseen: Mapping[str, Any] | None, point: Point[object]) -> PointComparison:
    rank: dict[str, float] = {}
    findings: list[str] = []
    if foreseen is None:
        return PointComparison(point.number, point.level, rank, ("no draw came as far",))
    if not point.accepted:
        if foreseen["accepted"] >= LIKELY:
            findings.append(f"refused ({point.reason}); {100.0 * foreseen['accepted']:.3g} % of the draws accept it")
        return PointComparison(point.number, point.level, rank, tuple(findings))
    for name, value in _values(point).items():
        quantiles = foreseen.get(name) or []
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
