"""Determine the level at which a run tripped, and refuse plans that ask for this level again."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.planning.levels import Levels
from rig.campaigns.planning.plan import Plan, Target
from rig.errors import ConfigurationError
from rig.recording.parts import Part
from rig.recording.reader import Recording
from rig.text.levels import level_text
from rig.tick.sequencer.layout import Outcome
from rig.tick.tick import Tick

NEVER_BEGUN = {Outcome.PENDING, Outcome.SKIPPED}
ALMOST = 1.0 - 1e-9  # levels that differ only by rounding count as equal


class TrippedAt(NamedTuple):
    """Where in a plan a run tripped."""

    level: float
    """Level at the trip."""
    level_unit: str
    """Unit of the level."""
    start: bool
    """Whether the level is ``start_v``, the voltage that sets the rig in motion, and not a level of the plan."""

    @property
    def text(self) -> str:
        """The level with its unit."""
        return level_text(self.level, self.level_unit) + (" at the start" if self.start else "")


def tripped_at(tick: Tick, plan: Plan, targets: Sequence[Target]) -> TrippedAt | None:
    """Return the level that was held or approached when the output was brought down; None before the first level."""
    segments, codes = tick.arrays.segments, [Outcome(int(code)) for code in tick.outcomes["outcome"]]
    index = max((i for i, code in enumerate(codes) if code not in NEVER_BEGUN), default=-1)
    if index < 0:
        return None
    by_law = int(segments[index]["amplitude_law"]) == int(plan.amplitude_law)
    level = float(segments[index]["level"])
    if int(segments[index]["point"]) < 0 and level > 0.0:
        return TrippedAt(level, plan.level_unit, start=False) if by_law else TrippedAt(level, "V", start=True)
    points = segments["point"][: index + 1]
    if not (points >= 0).any():
        return None
    number = int(points[np.flatnonzero(points >= 0)[-1]])
    levels = [target.level for target in targets if target.number in plan.together(number)]
    return TrippedAt(max(levels), plan.level_unit, start=False)


def refuse_tripped(recording: Recording, plan: Plan, left: Sequence[Target]) -> None:
    """Raise `ConfigurationError` if a target ``left`` to measure has a level that tripped, or a higher one.

    A trip is forgotten once a point at its level, or at a higher one, was accepted in a later part. No plan is allowed after a
    trip before the first level.
    """
    if not left:
        return
    for number, part in enumerate(recording.parts):
        if part.end is None or not part.end["tripped"]:
            continue
        at = _tripped_in(part)
        if at is not None:
            later = (point_from(table) for one in recording.parts[number + 1 :] for table in one.points)
            accepted = [point for point in later if point.accepted]  # any of them is beyond a trip at the start
            alike = [point.level for point in accepted if point.level_unit == at.level_unit]
            reached = bool(accepted) if at.start else any(level >= ALMOST * at.level for level in alike)
            if reached or not _asks_for(plan, left, at):
                continue
        head = f"{recording.path.name}: the run tripped{'' if at is None else f' at {at.text}'} ({part.end['text']})"
        lower = "" if at is None else f"`plan` with levels below {at.text}, or "
        if at is not None and at.start:
            lower = f"`plan` with start_v below {at.level:g}, or "
        raise ConfigurationError(f"{head}; to go on: {lower}`retry_tripped` to try it again")


def _tripped_in(part: Part) -> TrippedAt | None:
    """Return where a part tripped; for files of earlier versions, where its last point failed."""
    end = part.end or {}
    if "tripped_at" in end:
        return None if end["tripped_at"] is None else TrippedAt(**end["tripped_at"])
    failed = [point for point in map(point_from, part.points) if not point.accepted]
    return TrippedAt(failed[-1].level, failed[-1].level_unit, start=False) if failed else None


def _asks_for(plan: Plan, left: Sequence[Target], at: TrippedAt) -> bool:
    if at.start:
        start_v = plan.start_v if isinstance(plan, Levels) else None
        return start_v is None or start_v >= ALMOST * at.level
    return plan.level_unit != at.level_unit or any(target.level >= ALMOST * at.level for target in left)
