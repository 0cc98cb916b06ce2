"""Summarise in one line the points of a plan that a model does not include."""

from collections import Counter

from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.plans import plan_from
from rig.recording.reader import Recording
from rig.text.levels import level_text

_NOT_REACHED = "the recording ended before it"


def points_left_out(recording: Recording) -> tuple[str, ...]:
    """Return one note on the points of the plan that were not accepted; an empty tuple if all were.

    The note has their number, their levels, and the first reason.
    """
    plan = plan_from(recording.configuration["plan"], "plan of the recording")
    targets = plan.targets()
    points = {point.number: point for point in points_of(recording)}
    numbers = recording.plans[-1].numbers
    asked = zip(targets, range(len(targets)) if numbers is None else numbers, strict=True)
    results = [(target, points.get(number)) for target, number in asked if not target.repeats_first]
    out = [(target, point) for target, point in results if point is None or not point.accepted]
    if not out:
        return ()
    planned, lost = (Counter(target.level for target, _ in some) for some in (results, out))
    unit = plan.level_unit
    where = ", ".join(f"{lost[level]} of {planned[level]} at {level_text(level, unit, 'g')}" for level in sorted(lost))
    first = out[0][1]
    reason = _NOT_REACHED if first is None else first.reason
    return (
        f"{recording.path.name}: {len(out)} of {len(results)} points of the plan were not accepted and are left out "
        f"({where}); the first: {reason}",
    )
