"""Levels of an analysis: as requested, or up to the limits of the bench."""

from typing import Literal

import numpy as np

from rig.analysis.balance import Balance
from rig.analysis.subject import positive
from rig.errors import ConfigurationError
from simulators.analysis import NotConvergedError, PeriodicResponses
from vibrolock.arrays import Float

By = Literal["force", "voltage"]

_LOWEST_RATIO = 0.01
"""Default of the lowest level of a range, relative to the highest."""
_SEARCH_POINTS = 25  # voltages at which the bench's limits are sought; chosen
_MAX_POINTS = 20_000  # largest number of points; chosen


def level_range(balance: Balance, by: By, lowest: float | None, highest: float | None, points: int) -> Float:
    """Return geometrically spaced levels [points]: peaks of the fundamental force (N) or voltages (V).

    Without ``highest`` they end where the bench's limits or the valid range of the rig end the backbone.
    """
    unit = "n" if by == "force" else "v"
    if highest is None:
        path, last = highest_resonance(balance)
        highest = float(path.force_n[last] if by == "force" else path.voltage_v[last])
    high = positive(f"to_{unit}", highest)
    low = positive(f"from_{unit}", _LOWEST_RATIO * high if lowest is None else lowest)
    if low >= high:
        raise ConfigurationError(field=f"from_{unit}", value=low, allowed=f"less than to_{unit} = {high:g}")
    return np.geomspace(low, high, checked_points(points, 2))


def checked_points(points: int, least: int) -> int:
    """Return ``points`` if it lies within the allowed range; raise `ConfigurationError` otherwise."""
    ConfigurationError.unless_between("points", points, least, _MAX_POINTS)
    return points


def highest_resonance(balance: Balance) -> tuple[PeriodicResponses, int]:
    """Return a backbone over the voltages of the bench, and the index of its last point within the bench's limits."""
    subject = balance.subject
    limit_v = subject.bench.limits.voltage_v
    volts = np.geomspace(_LOWEST_RATIO * limit_v, limit_v, _SEARCH_POINTS)
    path = _over_voltages(balance, volts)
    allowed = subject.within(path)
    count = path.frequency_hz.size if np.all(allowed) else int(np.argmin(allowed))
    if count == 0:  # higher levels may leave further ranges, which is not the reason
        lowest = _over_voltages(balance, volts[:1])
        low_hz, high_hz = subject.bench.limits.frequency_hz
        violations = "; ".join(subject.limit_violations(lowest)) or (
            f"the resonance at {lowest.frequency_hz[0]:.4g} Hz is outside of limits.frequency_hz = {low_hz:g} to {high_hz:g} Hz"
        )
        raise ConfigurationError(f"already at {volts[0]:g} V the bench may not be driven at resonance ({violations})")
    return path, count - 1


def _over_voltages(balance: Balance, volts: Float) -> PeriodicResponses:
    try:
        return balance.backbone(voltages_v=volts)
    except NotConvergedError as failure:
        if failure.found is None:
            raise ConfigurationError(f"no resonance found at {volts[0]:g} V: {failure}") from failure
        return failure.found
