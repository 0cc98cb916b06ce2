"""Determine what remains to be measured of a recording, by its current plan or by a changed plan that replaces it.

A point is identified by its physical quantities, not by its place in a plan. It keeps its number in the recording permanently.
New points of a changed plan are numbered after all existing ones.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.lengths import check_length
from rig.campaigns.planning.plan import Plan, Target
from rig.campaigns.plans import bench_of, plan_from
from rig.errors import ConfigurationError
from rig.recording.reader import Recording
from rig.recording.stored import Information

Identity = tuple[object, ...]


@dataclass(frozen=True)
class Continuation:
    """How a recording is continued."""

    plan: Plan
    """The plan to follow."""
    bench: Bench
    """The bench of the recording."""
    numbers: tuple[int, ...]
    """Numbers in the recording of the plan's targets."""
    done: frozenset[int]
    """Places in the plan of the targets that are already accepted."""
    changed: bool
    """Whether the plan differs from the current plan of the recording."""

    @property
    def to_measure(self) -> tuple[Target, ...]:
        """Targets that are not done."""
        return tuple(target for place, target in enumerate(self.plan.targets()) if place not in self.done)

    def information(self) -> Information:
        """Return the table that a part records about a new plan; an empty table if the plan is unchanged."""
        if not self.changed:
            return {}
        return {"plan": self.plan.model_dump(mode="json"), "numbers": list(self.numbers)}


def remaining(recording: Recording, change: Plan | None = None, source: str | Path = "") -> Continuation:
    """Return how a recording is continued, by its current plan or by ``change``, a plan read from ``source``.

    Raises `ConfigurationError` if the changed plan cannot follow the current one or does not fit the bench.
    """
    name = recording.path.name
    plans = [(plan_from(said.plan, f"{name}: plan"), said.numbers) for said in recording.plans]
    bench = validated(Bench, recording.configuration["bench"], f"{name}: bench")
    plan, numbers = plans[-1]
    changed = change is not None and change != plan
    if change is not None and changed:
        _check(change, source, plan, bench, name)
        plan, numbers = change, numbered(plans, change)
    numbers = tuple(range(len(plan.targets())) if numbers is None else numbers)
    accepted = {point.number for point in map(point_from, recording.points) if point.accepted}
    done = frozenset(place for place, number in enumerate(numbers) if number in accepted)
    return Continuation(plan, bench, numbers, done, changed)


def identities(plan: Plan) -> tuple[Identity, ...]:
    """Return the physical identity of each target, with numbers rounded to nine digits. The last entry counts equal targets."""
    loop = plan.law.harmonics
    controlled = () if loop is None else (loop.channel, loop.highest, loop.left_alone, loop.wanted)
    common = _rounded((*(attrgetter(path)(plan) for path in KINDS[plan.kind].identity), *controlled))
    seen: Counter[Identity] = Counter()
    out = []
    for target in plan.targets():
        what = (*common, *_rounded(target.model_dump(exclude={"number"}).values()))
        out.append((*what, seen[what]))
        seen[what] += 1
    return tuple(out)


def _rounded(values: Iterable[object]) -> Identity:
    return tuple(_comparable(value) for value in values)


def _comparable(value: object) -> object:
    if isinstance(value, float):
        return f"{value + 0.0:.9g}"
    if isinstance(value, Mapping):
        return tuple(sorted((key, _comparable(item)) for key, item in value.items()))
    if isinstance(value, tuple | list):
        return _rounded(value)
    return value


def numbered(plans: Sequence[tuple[Plan, Sequence[int] | None]], change: Plan) -> tuple[int, ...]:
    """Return the number of each target of a changed plan: the old number if any earlier plan had this target, else a new one.

    ``plans`` are all plans so far, with the numbers of their targets (``None``: 0, 1, 2 and so on).
    """
    known: dict[Identity, int] = {}
    for plan, numbers in plans:
        for place, identity in enumerate(identities(plan)):
            known.setdefault(identity, place if numbers is None else numbers[place])
    following = 1 + max(known.values(), default=-1)
    out = []
    for identity in identities(change):
        if identity not in known:
            known[identity] = following
            following += 1
        out.append(known[identity])
    return tuple(out)


def _check(change: Plan, source: str | Path, before: Plan, bench: Bench, name: str) -> None:
    """Refuse a plan that cannot replace the previous one, or that the bench cannot carry out."""
    head = f"{source}: " if str(source) else ""
    if change.kind != before.kind:
        raise ConfigurationError(
            where=head,
            field="kind",
            value=change.kind,
            allowed=f"{before.kind!r}, the kind of {name}",
            hint="a test of another kind is recorded in a file of its own",
        )
    if change.level_unit != before.level_unit:
        raise ConfigurationError(
            f"{head}levels in {change.level_unit}: allowed are levels in {before.level_unit}, as in {name}; "
            "others are recorded in a file of their own"
        )
    for path in KINDS[change.kind].fixed:
        new, old = attrgetter(path)(change), attrgetter(path)(before)
        if new != old:
            raise ConfigurationError(where=head, field=path, value=new, allowed=f"{old!r}, with which {name} was begun")
    if change.bench != before.bench or change.bench.endswith(".toml"):
        named = bench_of(change, source)
        if (named.name, named.specimen.name) != (bench.name, bench.specimen.name):
            raise ConfigurationError(
                f"specimen {named.specimen.name}",
                where=head,
                field="bench",
                value=change.bench,
                allowed=f"{bench.name!r}, specimen {bench.specimen.name}, on which {name} was begun",
            )
    try:
        change.check(bench)
        check_length(change, bench)
    except ConfigurationError as error:
        raise ConfigurationError.of(error, where=head) from None


def changed_keys(before: Mapping[str, object], after: Mapping[str, object], path: str = "") -> list[str]:
    """Return the dotted paths of the keys in which two tables differ, in alphabetical order."""
    out = []
    for key in sorted({*before, *after}):
        old, new = before.get(key), after.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            out += changed_keys(old, new, f"{path}{key}.")
        elif old != new:
            out.append(f"{path}{key}")
    return out
