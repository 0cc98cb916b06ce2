"""Forecast of a run by a rehearsal: per point, the proportion accepted and the quantiles of what is measured."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from rig.arming.rehearsed import Rehearsed
from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.verdict import QUANTITIES, verdict_of

GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())  # probabilities of the quantiles that are forecast
MIN_DRAWS = 10  # least number of draws with a value for which quantiles are forecast; chosen


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


def forecast(rehearsal: Rehearsal) -> Forecast:
    """Return the forecast of a run by the draws of a rehearsal."""
    verdict = verdict_of(rehearsal)
    points = {}
    for one in verdict.points:
        found = [p for draw in rehearsal.draws for p in draw.trial.points if p.number == one.number and p.accepted]
        quantiles = {name: _quantiles(getattr(point, name) for point in found) for name in QUANTITIES}
        points[str(one.number)] = PointForecast(one.level, one.accepted.value, **quantiles)
    times = _quantiles(d.trial.duration_s for d in rehearsal.draws if d.trial.computed)
    return Forecast(verdict.trips.value, points, times)


def _quantiles(values: Iterable[float]) -> tuple[float, ...]:
    """Return the quantiles at 0, 5, ... 100 % of the finite values; nothing where there are few of them."""
    finite = np.array([value for value in values if np.isfinite(value)])
    return tuple(np.quantile(finite, GRID).tolist()) if finite.size >= MIN_DRAWS else ()


def rehearsed_in(rehearsal: Rehearsal, file: str) -> Rehearsed:
    """Return a rehearsal as the runner needs it."""
    verdict = verdict_of(rehearsal)
    return Rehearsed(
        file=file,
        digest=rehearsal.digest,
        tests=rehearsal.facts.tests,
        finished=rehearsal.finished,
        draws=len(rehearsal.draws),
        ends_well=verdict.ends_well.value,
        trips=verdict.trips.value,
        trips_at_most=verdict.trips_at_most,
        foreseen=asdict(forecast(rehearsal)),
    )
