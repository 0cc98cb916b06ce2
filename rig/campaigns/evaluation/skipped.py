"""Summarise in one line what a run has not measured, and what it has measured again."""

from collections.abc import Iterable

from rig.campaigns.evaluation.point import Point
from rig.text.levels import level_text


def skipped_summary(points: Iterable[Point[object]], planned: int) -> str:
    """Return the missing points by quality: ``3 of 13 points skipped: not-settled (0.1 N), unreachable (2 N)``.

    The text is empty if every point was accepted. ``points`` holds the last result of each number; ``planned`` is the number of
    points in the plan.
    """
    known = list(points)
    places: dict[str, list[str]] = {}
    for point in known:
        if not point.accepted:
            places.setdefault(point.quality, []).append(_place(point))
    causes = [f"{quality} ({', '.join(where)})" for quality, where in places.items()]
    untried = planned - len(known)
    if untried > 0:
        causes.append(f"not tried ({untried})")
    skipped = sum(map(len, places.values())) + untried
    return f"{skipped} of {planned} points skipped: {'; '.join(causes)}" if skipped else ""


def repeats_summary(points: Iterable[Point[object]]) -> str:
    """Return which points were measured again: ``measured again: points 3, 7; 3 attempts refused``; empty if none was."""
    again = [point for point in points if point.refused_before]
    refused = sum(len(point.refused_before) for point in again)
    names = ", ".join(str(point.number + 1) for point in again)
    counted = f"{refused} attempts" if refused > 1 else "1 attempt"
    return f"measured again: point{'s' if len(again) > 1 else ''} {names}; {counted} refused" if again else ""


def _place(point: Point[object]) -> str:
    where = [level_text(point.level, point.level_unit)]
    if point.asked_frequency_hz is not None:
        where.append(f"{point.asked_frequency_hz:.6g} Hz")
    if point.asked_phase_lag_deg is not None:
        where.append(f"{point.asked_phase_lag_deg:g} deg")
    return " ".join(where)
