"""Forecast of a run by a rehearsal: per point, the proportion accepted and the quantiles of what is measured."""

from dataclasses import dataclass

import numpy as np

GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())  # probabilities of the quantiles that are forecast


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
