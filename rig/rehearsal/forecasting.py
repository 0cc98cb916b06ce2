"""Make the forecast of a run from the draws of its rehearsal."""

from collections.abc import Iterable
from dataclasses import asdict

import numpy as np

from rig.arming.rehearsed import Rehearsed
from rig.rehearsal.forecast import GRID, QUANTITIES, Forecast, PointForecast
from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.verdict import verdict_of

MIN_DRAWS = 10  # least number of draws with a value for which quantiles are forecast; chosen


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
