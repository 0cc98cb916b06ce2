"""Drift of a specimen over a run: compare the first point with its repetition at the end of the run."""

from collections.abc import Iterable
from typing import TypedDict, TypeVar, cast

from rig.campaigns.evaluation.point import Point

Result = TypeVar("Result")


class Drift(TypedDict):
    """Relative changes from the first point to its repetition; None if one of the two lacks the quantity."""

    first: int
    """Number of the first point."""
    again: int
    """Number of its repetition."""
    frequency: float | None
    damping: float | None
    amplitude: float | None


def without_repetition(points: Iterable[Point[Result]]) -> list[Point[Result]]:
    """Return the points without the repetition of the first point."""
    return [point for point in points if not point.repeats_first]


def drift_of(points: Iterable[Point[object]]) -> Drift | None:
    """Return the relative changes from the first point to its repetition, with the numbers of both points.

    The changes are those of frequency, damping and amplitude. ``points`` are in the order of the plan. Returns None if the plan
    repeats no point or one of the two points was not accepted. A single change is None if one of the two points lacks the
    quantity. The frequency is the modal frequency, which a phase error does not affect.
    """
    known = list(points)
    again = next((point for point in known if point.repeats_first), None)
    first = None if again is None else next((p for p in without_repetition(known) if _same(p, again)), None)
    if first is None or again is None or not (first.accepted and again.accepted):
        return None
    before, now = _quantities(first), _quantities(again)
    changes = {name: relative_change(before.get(name), now.get(name)) for name in ("frequency", "damping", "amplitude")}
    return cast(Drift, {"first": first.number, "again": again.number, **changes})


def _quantities(point: Point[object]) -> dict[str, float | None]:
    out: dict[str, float | None] = {}
    if point.modal is not None:
        out |= {"frequency": point.modal.modal_frequency_hz, "damping": point.modal.damping_ratio}
    if point.vibration is not None:
        out["amplitude"] = point.vibration.amplitude_m
    return out


def _same(point: Point[object], again: Point[object]) -> bool:
    """Whether the plan asks for the same vibration in both points."""
    wanted, found = ((one.level, one.direction, one.repeat, one.asked_phase_lag_deg) for one in (again, point))
    return wanted == found


def relative_change(first: float | None, again: float | None) -> float | None:
    """Return the relative change of a quantity; None if one of its values is missing, or the first is 0."""
    return None if not first or again is None else again / first - 1.0
