"""What a rehearsal has found, as far as arming and the record need it: its verdict and what it foresees point by point."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from pydantic import BaseModel, JsonValue

from rig.arming.run_facts import user_name
from rig.bench import Bench
from rig.errors import NotArmed

BESIDE = {"name", "description", "arming"}
"""Keys of plan and bench that no test depends on."""


@dataclass(frozen=True, kw_only=True)
class Rehearsed:
    """A rehearsal as the runner sees it."""

    file: str
    """File of the rehearsal."""
    digest: str
    """Digest of the rehearsal."""
    tests: str
    """Digest of the plan and the bench that were rehearsed (`subject_digest`)."""
    finished: str
    """When, ISO 8601."""
    draws: int
    """Number of twins."""
    ends_well: float
    """Probability that every point is accepted."""
    trips: float
    """Probability of a trip."""
    trips_at_most: float
    """Upper end of its 95 % interval."""
    foreseen: Mapping[str, JsonValue]
    """What it foresees, point by point (`rig.rehearsal.forecast`)."""


def subject_digest(plan: BaseModel, bench: BaseModel) -> str:
    """Digest of plan and bench without what no test depends on: a rehearsal holds for these alone."""
    facts = [table.model_dump(mode="json", exclude=BESIDE) for table in (plan, bench)]
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]


def rehearsal_facts(plan: BaseModel, bench: Bench, rehearsed: Rehearsed | None, override: str) -> dict[str, JsonValue]:
    """Return what a recording keeps of a rehearsal: empty without one.

    Where the bench states ``arming.largest_trip_probability``, a rehearsal of this plan on this bench is needed whose
    probability of a trip stays below it with its whole 95 % interval, and which is not older than
    ``arming.rehearsal_valid_h``; otherwise `NotArmed` is raised, unless ``override`` says why the test runs all the same. Who
    overrode is kept. Raises `NotArmed` also for a rehearsal of something else.
    """
    against = _against(plan, bench, rehearsed)
    if against and not override:
        raise NotArmed(
            f"bench {bench.name}: {against}; nothing has moved (`override_rehearsal` = why it may run all the same)"
        )
    out: dict[str, JsonValue] = {} if rehearsed is None else asdict(rehearsed)
    if against:
        out["overridden"] = {"against": against, "why": override, "by": user_name()}
    return out


def _against(plan: BaseModel, bench: Bench, rehearsed: Rehearsed | None) -> str:
    largest = bench.arming.largest_trip_probability
    if rehearsed is None:
        if largest is None:
            return ""
        return f"arms only plans rehearsed with a trip probability below {100.0 * largest:g} %: rig rehearse, then `rehearsal`"
    if rehearsed.tests != subject_digest(plan, bench):
        return f"`rehearsal` = {rehearsed.file}: is of another plan or another bench"
    if largest is None:
        return ""
    if rehearsed.trips_at_most > largest:
        return (
            f"`rehearsal` = {rehearsed.file}: a trip has {100.0 * rehearsed.trips:.3g} %, with {rehearsed.draws} draws up to "
            f"{100.0 * rehearsed.trips_at_most:.3g} %; allowed is up to {100.0 * largest:g} %"
        )
    age_h = (datetime.now(UTC) - datetime.fromisoformat(rehearsed.finished)).total_seconds() / 3600.0
    if age_h > bench.arming.rehearsal_valid_h:
        return f"`rehearsal` = {rehearsed.file}: is {age_h:.1f} h old and is valid for {bench.arming.rehearsal_valid_h:g} h"
    return ""
