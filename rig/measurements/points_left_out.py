"""Points of a plan that a model knows nothing of, said in one line."""

from collections import Counter
from typing import Any

from rig.campaigns.plans import plan_from
from rig.recording.reader import Recording

__all__ = ["points_left_out"]

_NOT_REACHED: dict[str, Any] = {"accepted": False, "reason": "the recording ended before it"}


def points_left_out(recording: Recording) -> tuple[str, ...]:
    """One note with how many points of the plan were not accepted, at which levels, and the first reason; none if all were."""
    plan = plan_from(recording.configuration["plan"], "plan of the recording")
    targets = plan.targets()
    latest, numbers = recording.latest, recording.plans[-1].numbers
    found = zip(targets, range(len(targets)) if numbers is None else numbers, strict=True)
    results = {t.number: latest.get(number, _NOT_REACHED) for t, number in found if not t.repeats_first}
    out = {number: point for number, point in results.items() if not point["accepted"]}
    if not out:
        return ()
    planned = Counter(targets[number].level for number in results)
    lost = Counter(targets[number].level for number in out)
    unit = plan.level_unit
    where = ", ".join(f"{lost[level]} of {planned[level]} at {level:g} {unit}" for level in sorted(lost))
    reason = next(iter(out.values()))["reason"]
    return (
        f"{recording.path.name}: {len(out)} of {len(results)} points of the plan were not accepted and are left out "
        f"({where}); the first: {reason}",
    )
