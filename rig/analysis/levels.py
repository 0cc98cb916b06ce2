"""Levels of an analysis: as requested, or up to the limits of the bench."""

from typing import Literal

import numpy as np

from rig.analysis.subject import Subject, positive, refusing
from rig.errors import ConfigurationError
from simulators.analysis import NotConvergedError, PeriodicResponses, phase_resonance_backbone
from vibrolock.arrays import Float

By = Literal["force", "voltage"]

_LOWEST_SHARE = 0.01
"""Default of the lowest level of a range, relative to the highest."""
_SEARCHED = 25
_MOST_POINTS = 20_000


def level_range(
    subject: Subject, by: By, lowest: float | None, highest: float | None, points: int, harmonics: int
) -> Float:
    """Return geometrically spaced levels [points]: peaks of the fundamental force (N) or voltages (V).

    Without ``highest`` they end where the bench's limits or the valid range of the rig end the backbone.
    """
    unit = "n" if by == "force" else "v"
    if highest is None:
        path, last = highest_resonance(subject, harmonics)
        highest = float(path.force_n[last] if by == "force" else path.voltage_v[last])
    high = positive(f"to_{unit}", highest)
    low = positive(f"from_{unit}", _LOWEST_SHARE * high if lowest is None else lowest)
    if low >= high:
        raise ConfigurationError(f"from_{unit} = {low:g}: allowed is less than to_{unit} = {high:g}")
    return np.geomspace(low, high, most_points(points, 2))


def most_points(points: int, least: int) -> int:
    """Return ``points`` if it lies within the allowed range; raise `ConfigurationError` otherwise."""
    if not least <= points <= _MOST_POINTS:
        raise ConfigurationError(f"points = {points}: allowed is {least} to {_MOST_POINTS}")
    return points


def highest_resonance(subject: Subject, harmonics: int) -> tuple[PeriodicResponses, int]:
    """Return a backbone over the voltages of the bench, and the index of its last point within the bench's limits."""
    limit_v = subject.bench.limits.voltage_v
    volts = np.geomspace(_LOWEST_SHARE * limit_v, limit_v, _SEARCHED)
    path = _over_voltages(subject, volts, harmonics)
    allowed = subject.within(path)
    count = path.frequency_hz.size if np.all(allowed) else int(np.argmin(allowed))
    if count == 0:  # higher levels may leave further ranges, which is not the reason
        lowest = _over_voltages(subject, volts[:1], harmonics)
        low_hz, high_hz = subject.bench.limits.frequency_hz
        excesses = "; ".join(subject.excesses(lowest)) or (
            f"the resonance at {lowest.frequency_hz[0]:.4g} Hz is outside of limits.frequency_hz = {low_hz:g} to {high_hz:g} Hz"
        )
        raise ConfigurationError(f"already at {volts[0]:g} V the bench may not be driven at resonance ({excesses})")
    return path, count - 1


def _over_voltages(subject: Subject, volts: Float, harmonics: int) -> PeriodicResponses:
    """Return the backbone over voltages, as far as it is found; raise `ConfigurationError` if nothing is."""
    try:
        with refusing():
            return phase_resonance_backbone(
                subject.rig,
                voltages_v=volts,
                near_hz=subject.near_hz,
                harmonics=harmonics,
                samples=samples_for(harmonics),
            )
    except NotConvergedError as failure:
        if failure.found is None:
            raise ConfigurationError(f"no resonance found at {volts[0]:g} V: {failure}") from failure
        return failure.found


def samples_for(harmonics: int) -> int:
    """Return enough samples per period for the nonlinear forces: 512 up to 15 harmonics, then in proportion."""
    return max(512, 32 * (harmonics + 1))
