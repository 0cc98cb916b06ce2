"""How far a specimen has drifted over a run: its first point, measured once more at the end, against the first time."""

from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["drift_of", "of_the_result"]

QUANTITIES = {"frequency": "modal_frequency_hz", "damping": "damping_ratio", "amplitude": "amplitude_m"}
"""What is compared, by the key that a point has it under. The modal frequency, for it knows nothing of the lag's error."""

Point = Mapping[str, Any]


def of_the_result(points: Iterable[Point]) -> list[Point]:
    """The points without the repeated one."""
    return [point for point in points if not point.get("repeats_first")]


def drift_of(points: Iterable[Point]) -> dict[str, Any] | None:
    """Relative changes from the first point to its repetition, and their numbers in the recording.

    ``points``: the results in the order of the plan. None where the plan repeats nothing, or one of the two was not accepted; a
    single change is None where one of the two has no such number.
    """
    known = list(points)
    again = next((point for point in known if point.get("repeats_first")), None)
    first = None if again is None else next((p for p in of_the_result(known) if _same(p, again)), None)
    if first is None or again is None or not (first["accepted"] and again["accepted"]):
        return None
    changes = {name: _change(first.get(key), again.get(key)) for name, key in QUANTITIES.items()}
    return {"first": first["number"], "again": again["number"], **changes}


def _same(point: Point, again: Point) -> bool:
    keys = ("level", "direction", "repeat", "asked_phase_lag_deg")
    return all(point.get(key) == again.get(key) for key in keys)


def _change(first: float | None, again: float | None) -> float | None:
    return None if not first or again is None else again / first - 1.0
