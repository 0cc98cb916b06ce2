"""Drift of a specimen over a run: compare the first point with its repetition at the end of the run."""

from collections.abc import Iterable
from operator import attrgetter
from typing import TypedDict, TypeVar

from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.stored_point import value_of

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
    alike = attrgetter("level", "direction", "repeat", "asked_phase_lag_deg")
    first = None if again is None else next((p for p in without_repetition(known) if alike(p) == alike(again)), None)
    if first is None or again is None or not (first.accepted and again.accepted):
        return None

    def change(quantity: str) -> float | None:
        return relative_change(value_of(first, quantity), value_of(again, quantity))

    return Drift(
        first=first.number,
        again=again.number,
        frequency=change("modal_frequency_hz"),
        damping=change("damping_ratio"),
        amplitude=change("amplitude_m"),
    )


def relative_change(first: float | None, again: float | None) -> float | None:
    """Return the relative change of a quantity; None if one of its values is missing, or the first is 0."""
    return None if not first or again is None else again / first - 1.0
