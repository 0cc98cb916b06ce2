"""A plan that is bad in one way gets the remedy for that, and not another one."""

from types import SimpleNamespace

import numpy as np
import pytest

from rig.campaigns.plans import load_plan, plan_from
from rig.rehearsal import remedies
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.rehearsal.remedies import Remedy, _evenly_chosen, _rates, improve, remedies_for
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import SHORT, magnet_beam

CALM = Hypotheses(hardening=0.0, softening=0.0, joint=0.0, stop=0.0, second_mode=0.0, gain=0.0)


def spoilt(**changes):
    table = SHORT.model_dump(mode="json", exclude_none=True)
    for key, value in changes.items():
        table[key] = table[key] | value if isinstance(value, dict) else value
    return plan_from(table, "spoilt plan")


def improved(plan, hypotheses=CALM, draws=2, bench=None):
    request = RehearsalRequest(
        plan=plan,
        bench=bench or magnet_beam(),
        knowledge=knowledge_of_the_magnet_beam(),
        hypotheses=hypotheses,
        draws=draws,
    )
    first = rehearse(request)
    return first, improve(request, first)


def test_a_plan_without_patience_is_given_some():
    first, found = improved(spoilt(settle={"longest_periods": 40.0}))
    assert not any(draw.trial.completed for draw in first.draws)
    assert found.changes == {"settle": {"longest_periods": 120.0}}
    taken = [effect for effect in found.effects if effect.taken]
    assert [effect.name for effect in taken] == ["three times as long to settle"]
    assert taken[0].ends_well == (0.0, 1.0)
    assert found.plan.settle.longest_periods == 120.0


@pytest.mark.slow
def test_a_window_that_is_too_narrow_is_widened():
    hypotheses = CALM.model_copy(update={"hardening": 1.0, "shift": (0.02, 0.04)})
    narrow = spoilt(controller={"frequency_window_hz": [23.9, 24.6]}, levels_v=[0.4, 2.0])
    first, found = improved(narrow, hypotheses)
    assert not any(draw.trial.completed for draw in first.draws)
    low, high = found.changes["controller"]["frequency_window_hz"]
    assert low < 23.9 < 24.6 < high


@pytest.mark.slow
def test_a_level_that_trips_is_left_out():
    bench = magnet_beam()
    bench = bench.model_copy(update={"limits": bench.limits.model_copy(update={"displacement_m": 6e-4})})
    first, found = improved(spoilt(levels_v=[0.2, 0.4, 2.0]), bench=bench)
    assert all(draw.trial.tripped for draw in first.draws)
    assert found.changes == {"levels_v": [0.2, 0.4]}


def test_a_good_plan_stays_as_it_is():
    first, found = improved(SHORT)
    assert all(draw.trial.completed for draw in first.draws)
    assert (found.changes, found.effects, found.plan) == ({}, (), SHORT)


@pytest.mark.parametrize(
    "name",
    [
        "magnet-beam/backbone",
        "magnet-beam/stepped-phase-paper",
        "magnet-beam/sweep-1",
        "magnet-beam/multisine-1",
        "friction-beam/dwell",
    ],
)
def test_every_kind_of_plan_has_remedies_that_are_plans(name):
    plan = load_plan(name)
    table = plan.model_dump(mode="json", exclude_none=True)
    for remedy in remedies_for(plan, magnet_beam(), ()):
        for key in remedy.changes:
            assert key in type(plan).model_fields, remedy.name
            assert remedy.changes[key] != table.get(key), remedy.name


def test_other_levels_keep_the_longer_ramps():
    table = load_plan("magnet-beam/backbone").model_dump(mode="json", exclude_none=True)
    plan = plan_from(table | {"levels_v": [0.4, 0.1, 0.2], "ramp_factors": [4.0, 1.0, 2.0]}, "longer")
    changes = {remedy.name: remedy.changes for remedy in remedies_for(plan, magnet_beam(), ())}
    assert changes["without the lowest level"] == {"levels_v": [0.2, 0.4], "ramp_factors": [2.0, 4.0]}
    assert changes["a first level of a third"]["ramp_factors"] == [1.0, 1.0, 2.0, 4.0]
    assert changes["steps half as large"]["ramp_factors"] == [1.0, 2.0, 2.0, 4.0, 4.0]


def draw(number, *, completed, tripped=False, accepted=0, computed=True):
    points = tuple(SimpleNamespace(accepted=k < accepted) for k in range(10))
    trial = SimpleNamespace(
        computed=computed, completed=completed, tripped=tripped, points=points, duration_s=1.0, level=np.nan
    )
    return SimpleNamespace(number=number, trial=trial)


@pytest.mark.parametrize("number", [25, 60, 100, 241])
def test_a_sample_of_draws_reaches_from_the_first_to_the_last_in_even_steps(number):
    sample = _evenly_chosen(range(number))
    assert (len(sample), sample[0], sample[-1]) == (24, 0, number - 1)
    steps = np.diff(sample)
    assert steps.min() >= 1
    assert steps.max() - steps.min() <= 1


@pytest.mark.parametrize("number", [0, 1, 24])
def test_few_draws_are_all_in_the_sample(number):
    assert _evenly_chosen(range(number)) == list(range(number))


@pytest.mark.parametrize(("failed", "well"), [(30, 90), (90, 30), (1, 100), (30, 1), (30, 0)])
def test_probabilities_of_a_sample_are_those_of_all_draws_that_it_stands_for(monkeypatch, failed, well):
    """Failed draws trip after 4 of 10 points; the remedy lets all complete, so that both ends are known exactly."""
    plan = SimpleNamespace(targets=lambda: range(10))
    other = SimpleNamespace(targets=lambda: range(8))  # fewer points are no gain by themselves
    draws = [draw(k, completed=False, tripped=True, accepted=4) for k in range(failed)]
    draws += [draw(failed + k, completed=True, accepted=10) for k in range(well)]
    draws += [draw(failed + well, completed=False, computed=False)]  # of this one nothing is known
    monkeypatch.setattr(remedies, "remedies_for", lambda *_: [Remedy("help", {"retries": 3})])
    monkeypatch.setattr(remedies, "_changed", lambda *_: other)
    monkeypatch.setattr(remedies, "replace", lambda one, **changes: SimpleNamespace(**(vars(one) | changes)))
    asked = []

    def again(request, sample, jobs):
        asked.append([one.number for one in sample])
        return [draw(one.number, completed=True, accepted=8) for one in sample]

    monkeypatch.setattr(remedies, "_rerun", again)
    told = []
    found = improve(SimpleNamespace(plan=plan, bench=None), SimpleNamespace(draws=draws), progress=told.append)
    share = failed / (failed + well)
    (effect,) = told
    assert effect.ends_well == (pytest.approx(1.0 - share), 1.0)
    assert effect.trips == (pytest.approx(share), 0.0)
    assert effect.points == (pytest.approx(1.0 - 0.6 * share), pytest.approx(0.8))
    assert effect.draws == len(asked[0]) == min(failed, 24) + min(well, 24)
    rise = 0.8 - (1.0 - 0.6 * share) + 2.0 * share  # of the points, less twice the trips
    assert found.plan is (other if rise > 0.02 else plan)


def test_points_beyond_those_asked_for_count_no_more():
    two = [draw(0, completed=True, accepted=10), draw(1, completed=False, accepted=4)]
    assert _rates(two, {0: 3.0, 1: 1.0}, 8) == (0.75, 0.0, 0.875)  # (3 * 1 + 1 * 0.5) / 4
