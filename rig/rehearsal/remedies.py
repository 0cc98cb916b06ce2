"""Remedies for a plan: changes that are tried on the same twins, one at a time and then together."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rig.bench import Bench
from rig.bench.configuration import merged
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.planning.levels import Levels
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import plan_from
from rig.errors import RigError
from rig.rehearsal.rehearsal import Draw, Effect, Rehearsal, RehearsalRequest, Table
from rig.text.levels import level_text
from simulators.ensemble import ensemble

GAINS = ("k1", "k2", "frequency_integral_per_s", "response_integral_per_s", "reference_integral_per_s")
"""Gains of a loop that a remedy scales."""
MAX_EACH = 24
"""Draws that failed, and draws that ended well, on which a remedy is tried; chosen: a compromise with the time it takes."""
MAX_STEPS = 4  # remedies that are combined at most; chosen
MIN_RISE = 0.02  # rise of the score for which a remedy is taken, over the draws; chosen
TRIP_WEIGHT = 2.0  # weight of a trip over that of a missing point; chosen


@dataclass(frozen=True)
class Remedy:
    """A change of a plan."""

    name: str
    """What is changed, in a few words."""
    changes: Table
    """Keys of the plan with their new values."""


@dataclass(frozen=True, eq=False)
class Improvement:
    """An improved plan, and what was tried."""

    plan: Plan
    """The plan with all remedies that were taken; the given plan if none helped."""
    changes: Mapping[str, object]
    """All changes together."""
    effects: tuple[Effect, ...]
    """Every remedy that was tried, in the order of trying."""


def remedies_for(plan: Plan, bench: Bench, draws: Sequence[Draw]) -> list[Remedy]:
    """Return the changes that may help this kind of plan on this bench."""
    table = plan.model_dump(mode="json")
    levels = _levels(plan, draws) if isinstance(plan, Levels) else ()
    return [*_ramps(table), *_windows(table, bench), *levels, *_gains(table), *_waiting_times(table)]


def _ramps(table: Table) -> Iterator[Remedy]:
    if isinstance(periods := table.get("ramp_periods"), int | float):
        for times in (4.0, 16.0):
            yield Remedy(f"ramps {times:g} times as long", {"ramp_periods": times * periods})
    if table.get("on_lost_lock") == "stop" and "dwell" not in str(table["kind"]):
        yield Remedy("a lost lock skips its point", {"on_lost_lock": "skip"})


def _windows(table: Table, bench: Bench) -> Iterator[Remedy]:
    window = _section(table, "controller").get("frequency_window_hz")
    if not isinstance(window, list):
        return
    low, high = (end for end in window if isinstance(end, int | float))
    lowest, highest = bench.limits.frequency_hz
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for times in (1.5, 2.5):
        start, end = max(middle - times * half, lowest), min(middle + times * half, highest)
        if start > 0.4 * middle and [start, end] != window:
            wider: Table = {"frequency_window_hz": [start, end]}
            yield Remedy(f"a frequency window {times:g} times as wide", {"controller": wider})


def _levels(plan: Levels, draws: Sequence[Draw]) -> Iterator[Remedy]:
    levels, start = sorted(plan.levels), plan.start_v

    def changed(words: str, others: list[float], start_v: float | None = start) -> Remedy:
        out: Table = {plan.levels_key: [*others]}
        # a ramp is as much longer as the one over its level was
        if isinstance(plan, BackbonePlan) and plan.ramp_factors:
            factor_of = dict(zip(plan.levels, plan.ramp_factors, strict=True))
            over = [levels[min(bisect_left(levels, level), len(levels) - 1)] for level in others]
            out["ramp_factors"] = [factor_of[level] for level in over]
        if start_v != start:
            out["start_v"] = start_v
        return Remedy(words, out)

    third = None if start is None else start / 3.0
    yield changed("a first level of a third", [levels[0] / 3.0, *levels], third)
    if len(levels) > 1:
        second = None if start is None else start * levels[1] / levels[0]
        yield changed("without the lowest level", levels[1:], second)
        finer = [level for low, high in pairwise(levels) for level in (low, float(np.sqrt(low * high)))]
        yield changed("steps half as large", [*finer, levels[-1]])
    tripped = [draw.trial.level for draw in draws if draw.trial.tripped and np.isfinite(draw.trial.level)]
    below = [level for level in levels if not tripped or level < min(tripped) * (1.0 - 1e-9)]
    if below and len(below) < len(levels):
        yield changed(f"levels up to {level_text(below[-1], plan.level_unit, '.3g')}", below)


def _gains(table: Table) -> Iterator[Remedy]:
    controller = _section(table, "controller")
    gains = {name: gain for name in GAINS if isinstance(gain := controller.get(name), int | float) and gain}
    for words, times in (("half", 0.5), ("twice", 2.0)) if gains else ():
        scaled: Table = {name: times * gain for name, gain in gains.items()}
        yield Remedy(f"{words} the gains", {"controller": scaled})


def _waiting_times(table: Table) -> Iterator[Remedy]:
    if isinstance(longest := _section(table, "settle").get("longest_periods"), int | float):
        yield Remedy("three times as long to settle", {"settle": {"longest_periods": 3.0 * longest}})
    if isinstance(periods := table.get("record_periods"), int):
        yield Remedy("twice the recorded periods", {"record_periods": 2 * periods})
    if isinstance(retries := table.get("retries"), int):
        yield Remedy("three more retries", {"retries": retries + 3})


def _section(table: Table, key: str) -> Table:
    section = table.get(key)
    return section if isinstance(section, dict) else {}


def improve(
    request: RehearsalRequest,
    rehearsal: Rehearsal,
    *,
    progress: Callable[[Effect], None] = lambda _: None,
    jobs: int | None = None,
) -> Improvement:
    """Try remedies on twins of a rehearsal, take the best, try the others on top of it, and so on.

    A remedy is tried on up to 24 draws that did not end well and as many that did; probabilities are weighted by how many each
    stand for. It is taken if the accepted points, as a share of those asked for, less twice the probability of a trip rise by
    more than 0.02; of remedies that help equally the quickest is taken. The improved plan deserves a rehearsal of its own with
    other draws, for it was chosen by these.
    """
    failed = [draw for draw in rehearsal.draws if draw.trial.computed and not draw.trial.completed]
    well = [draw for draw in rehearsal.draws if draw.trial.completed]
    sample, weights = list[Draw](), dict[int, float]()
    for draws in (failed, well):
        chosen = _evenly_chosen(draws)
        sample += chosen
        weights |= {draw.number: len(draws) / len(chosen) for draw in chosen}
    plan, effects = request.plan, list[Effect]()
    changes: Mapping[str, object] = {}
    asked = len(request.plan.targets())
    now, candidates = sample, remedies_for(plan, request.bench, rehearsal.draws)
    for _ in range(MAX_STEPS):
        before = _rates(now, weights, max(asked, len(plan.targets())))
        if not any(not draw.trial.completed for draw in now):
            break
        tried: list[tuple[float, float, Remedy, Plan, list[Draw]]] = []
        for remedy in candidates:
            changed = _changed(plan, remedy.changes, request.bench)
            if changed is None:
                continue
            on_the_same = replace(request, plan=changed, drawn_for=request.plan, balanced=False)
            found = _rerun(on_the_same, sample, jobs)
            after = _rates(found, weights, max(asked, len(changed.targets())))
            both = [(before[i], after[i]) for i in range(3)]
            effect = Effect(remedy.name, remedy.changes, both[0], both[1], both[2], len(sample))
            effects.append(effect)
            progress(effect)
            duration_s = float(np.nanmedian([draw.trial.duration_s for draw in found]))
            tried.append((_score(after) - _score(before), -duration_s, remedy, changed, found))
        if not tried:
            break
        rise, _, remedy, changed, found = max(tried, key=lambda entry: (round(entry[0], 6), entry[1]))
        if rise <= MIN_RISE:
            break
        effects = [
            replace(e, taken=True) if e.name == remedy.name and e.ends_well[0] == before[0] else e for e in effects
        ]
        plan, now = changed, found
        changes = merged(changes, remedy.changes)
        taken = set(_paths(remedy.changes))  # what changes the same keys is not tried again
        candidates = [one for one in remedies_for(plan, request.bench, found) if taken.isdisjoint(_paths(one.changes))]
    return Improvement(plan, changes, tuple(effects))


def _paths(changes: Mapping[str, object], prefix: str = "") -> Iterator[str]:
    for key, value in changes.items():
        if isinstance(value, Mapping):
            yield from _paths(value, f"{prefix}{key}.")
        else:
            yield prefix + key


def _evenly_chosen(draws: Sequence[Draw]) -> list[Draw]:
    if len(draws) <= MAX_EACH:
        return list(draws)
    return [draws[i] for i in np.linspace(0, len(draws) - 1, MAX_EACH).round().astype(int)]


def _rates(draws: Sequence[Draw], weights: Mapping[int, float], asked: int) -> tuple[float, float, float]:
    """Weighted probabilities of a good end and of a trip, and the share of the points asked for that are accepted."""
    total = sum(weights[draw.number] for draw in draws)
    well = sum(weights[draw.number] for draw in draws if draw.trial.completed) / total
    trips = sum(weights[draw.number] for draw in draws if draw.trial.tripped) / total
    shares = [min(1.0, sum(point.accepted for point in draw.trial.points) / asked) for draw in draws]
    points = sum(weights[draw.number] * share for draw, share in zip(draws, shares, strict=True)) / total
    return well, trips, points


def _score(rates: tuple[float, float, float]) -> float:
    """Value of a plan: points that it gives, less its trips. Fewer levels are no gain by themselves."""
    return rates[2] - TRIP_WEIGHT * rates[1]


def _changed(plan: Plan, changes: Table, bench: Bench) -> Plan | None:
    try:
        changed = plan_from(merged(plan.model_dump(mode="json", exclude_none=True), changes), "changed plan")
        changed.check(bench)
    except RigError:
        return None
    return changed


def _rerun(request: RehearsalRequest, sample: Sequence[Draw], jobs: int | None) -> list[Draw]:
    return [draw for _, draw in ensemble({str(d.number): d.number for d in sample}, request, n_jobs=jobs)]
