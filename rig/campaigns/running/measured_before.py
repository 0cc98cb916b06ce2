"""What earlier parts of a recording have measured of a plan, and what that leaves for the next attempts of the same run."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field

from rig.campaigns.evaluation.point import Attempt, Point
from rig.campaigns.running.attempts import attempt_at


@dataclass(frozen=True)
class MeasuredBefore:
    """Results of earlier parts of the recording that concern the plan."""

    done: frozenset[int] = frozenset()
    """Numbers in the plan of the points that were accepted."""
    numbers: Sequence[int] | None = None
    """Number in the recording of every point of the plan; None if it equals the number in the plan."""
    points: tuple[Point[object], ...] = ()
    """All points of the recording so far."""
    given_up: frozenset[int] = frozenset()
    """Numbers in the plan of the points that were not accepted and are not measured again."""
    attempts: Mapping[int, tuple[Attempt, ...]] = field(default_factory=dict)
    """Refused attempts of the same run at points that are measured again, by their number in the plan."""


def measured_before_repeat(
    numbers: Sequence[int],
    known: tuple[Point[object], ...],
    again: Set[int],
    attempts: Mapping[int, tuple[Attempt, ...]],
) -> MeasuredBefore:
    """Return what was measured before the points ``again`` of a plan are measured again in the same run.

    ``numbers`` are the numbers in the recording of the plan's points, ``known`` all points of the recording, ``attempts`` the
    refused attempts before the last results. All other points count as given up unless they were accepted.
    """
    last = {point.number: point for point in known}
    accepted = {point.number for point in known if point.accepted}
    done = frozenset(place for place, number in enumerate(numbers) if number in accepted)
    given_up = frozenset(range(len(numbers))) - done - again
    refused = {place: (*attempts.get(place, ()), attempt_at(last[numbers[place]])) for place in again}
    return MeasuredBefore(done, numbers, known, given_up, refused)
