"""Tell whether a recorded point was refused for something that passes: a fault of the device for a while, or a disturbance."""

import numpy as np

from identification.signals import unwrapped
from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged
from rig.campaigns.evaluation.point import Point, Quality
from rig.campaigns.evaluation.rows import Rows, stretches

STANDS_OUT = 4.0
"""Times the usual change from period to period; noise in a whole period, or a lasting beat, stays below 2."""
FEWEST_PERIODS = 4  # for a median of changes from period to period; chosen


def refused_for_a_transient(point: Point[object], bench: Bench, rows: Rows, faults: int, steady: bool) -> bool:
    """Return whether a point was refused, but for something that passes, so that it is worth another attempt.

    That is a passing fault of the device (``faults``: samples with a held output, and lost ones, while the point was approached
    and recorded), or, in the ``rows`` of a ``steady`` vibration, a disturbance that came and went.
    """
    return point.quality is Quality.REJECTED and (faults > 0 or (steady and has_transient_disturbance(bench, rows)))


def has_transient_disturbance(bench: Bench, rows: Rows) -> bool:
    """Return whether force or drive changed from one period to the next far more somewhere than it usually did.

    The RMS of the difference between neighbouring periods, taken at equal phases, is that of the noise in a steady vibration,
    whatever its harmonics. Another mode or a loop that swings adds to it everywhere, a knock in a few periods only.
    """
    found = [changes for stretch in stretches(rows) if (changes := _changes(bench, stretch)) is not None]
    if not found:
        return False
    return any(changes.max() > STANDS_OUT * np.median(changes) for changes in np.concatenate(found, axis=1))


def _changes(bench: Bench, rows: Rows) -> np.ndarray | None:
    """Return the RMS of the changes of force and drive from period to period, float64[2, n]; None if there are too few."""
    turns = unwrapped(rows["theta_rad"].astype(float)) / (2.0 * np.pi)
    periods = int(turns[-1] - turns[0]) if np.isfinite(turns).all() else 0
    if periods < FEWEST_PERIODS + 1:
        return None
    per_period = rows.size // (periods + 1)
    at = turns[0] + np.arange(periods * per_period) / per_period
    inputs = bridged(rows)[:, [bench.index_of("force"), bench.index_of("drive")]]
    signals = np.array([np.interp(at, turns, one) for one in inputs.T]).reshape(2, periods, per_period)
    return np.asarray(np.sqrt(np.mean(np.diff(signals, axis=1) ** 2, axis=2)))
