"""What a rehearsal foresees of a run."""

from typing import Any

import numpy as np

from rig.arming.rehearsed import Rehearsed
from rig.rehearsal.comparison import GRID
from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.verdict import verdict_of

QUANTITIES = ("frequency_hz", "force_n", "amplitude_m", "voltage_v", "damping_ratio")
FEW = 10  # draws with a value, below which nothing is foreseen


def foreseen_by(rehearsal: Rehearsal) -> dict[str, Any]:
    """Return what a rehearsal foresees, as plain data: for each point the share accepted and the sorted values of the draws."""
    verdict = verdict_of(rehearsal)
    points = {}
    for one in verdict.points:
        found = [p for draw in rehearsal.draws for p in draw.trial.points if p.number == one.number and p.accepted]
        values = {name: np.sort([getattr(point, name) for point in found]) for name in QUANTITIES}
        points[str(one.number)] = {
            "level": one.level,
            "accepted": one.accepted.value,
            **{name: _quantiles(v[np.isfinite(v)]) for name, v in values.items()},
        }
    return {
        "trips": verdict.trips.value,
        "duration_s": _quantiles(np.sort([d.trial.duration_s for d in rehearsal.draws if d.trial.computed])),
        "points": points,
    }


def _quantiles(values: Any) -> list[float]:
    """Return the quantiles at 0, 5, ... 100 %; nothing where there are few values."""
    return [float(v) for v in np.quantile(values, GRID)] if len(values) >= FEW else []


def rehearsed_in(rehearsal: Rehearsal, file: str) -> Rehearsed:
    """Return a rehearsal as the runner wants it."""
    verdict = verdict_of(rehearsal)
    return Rehearsed(
        file=file,
        digest=rehearsal.digest,
        tests=rehearsal.tests,
        finished=rehearsal.finished,
        draws=len(rehearsal.draws),
        ends_well=verdict.ends_well.value,
        trips=verdict.trips.value,
        trips_at_most=verdict.trips_at_most,
        foreseen=foreseen_by(rehearsal),
    )
