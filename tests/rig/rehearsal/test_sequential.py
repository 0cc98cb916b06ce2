"""A rehearsal ends once its verdict is certain; estimates and intervals then hold all the same."""

import math
from itertools import product

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.rehearsal import rehearsal
from rig.rehearsal.rehearsal import Rehearsal, RehearsalRequest, rehearse
from rig.rehearsal.report import lines, summary
from rig.rehearsal.sequential import BADLY, ERROR, WELL, fewest_further, interval, is_certain, unbiased
from rig.rehearsal.verdict import verdict_of
from tests.rig.rehearsal.test_verdict import FACTS, draw_of


def ends_of(p, most):
    """Where the test ends, with the probability of each end, by recursion over its draws."""
    now, ends = {0: 1.0}, {}
    for draws in range(1, most + 1):
        later = {}
        for (k, chance), step in product(now.items(), (0, 1)):
            later[k + step] = later.get(k + step, 0.0) + chance * (p if step else 1.0 - p)
        over = {k for k in later if is_certain(k, draws) or draws == most}
        ends |= {(k, draws): later.pop(k) for k in over}
        now = later
    assert sum(ends.values()) == pytest.approx(1.0)
    return ends


@pytest.mark.parametrize("p", [0.1, 0.6, 0.9, 0.99])
def test_the_estimate_has_no_bias_and_the_interval_holds(p):
    ends = ends_of(p, 40)
    assert sum(chance * unbiased(*end) for end, chance in ends.items()) == pytest.approx(p, rel=1e-9)
    covered = sum(chance for end, chance in ends.items() if interval(*end)[0] <= p <= interval(*end)[1])
    assert covered >= 0.95


@pytest.mark.parametrize(("p", "wrong"), [(BADLY, 1), (WELL, -1)])
def test_the_wrong_end_is_as_rare_as_stated(p, wrong):
    ends = ends_of(p, 400)
    error = sum(
        chance for (k, n), chance in ends.items() if is_certain(k, n) and math.copysign(1, k / n - 0.9) == wrong
    )
    assert error <= 1.05 * ERROR


def test_a_plan_that_always_or_never_ends_well_is_told_after_few_draws():
    assert next(n for n in range(1, 100) if is_certain(n, n)) == 27
    assert next(n for n in range(1, 100) if is_certain(0, n)) == 3


@pytest.mark.parametrize(
    ("badly", "begun"),
    [((), [27]), ((4,), [27, 11]), ((4, 30), [27, 11, 2]), (range(40), [27]), ((0, 1, 26), [27, 13])],
)
def test_no_more_twins_are_begun_than_the_verdict_needs_if_all_of_them_end_well(monkeypatch, badly, begun):
    handed = []

    def ensemble(variants, request, *, n_jobs=None):
        handed.append(len(variants))
        for name, number in variants.items():
            yield name, draw_of(number, **({"end": "TRIP"} if number in badly else {}))

    monkeypatch.setattr(rehearsal, "ensemble", ensemble)
    request = RehearsalRequest(plan=load_plan("magnet-beam/backbone"), bench=load_bench("magnet-beam"), draws=40)
    found = rehearse(request, until_certain=True)
    assert handed == begun
    assert [draw.number for draw in found.draws] == list(range(len(found.draws)))
    ended = len(found.draws)
    well = sum(draw.trial.completed for draw in found.draws)
    assert is_certain(well, ended) or ended == 40
    assert ended == 40 or not is_certain(sum(draw.trial.completed for draw in found.draws[:-1]), ended - 1)


@pytest.mark.parametrize(("well", "of"), [(0, 0), (20, 21), (40, 44)])
def test_fewer_further_draws_do_not_end_the_test(well, of):
    more = fewest_further(well, of)
    assert is_certain(well + more, of + more)
    assert not is_certain(well + more - 1, of + more - 1)


def test_the_page_says_how_many_draws_there_might_have_been():
    draws = tuple(draw_of(n, end="TRIP") for n in range(3))
    found = Rehearsal(facts=FACTS, draws=draws, finished="now", at_most=40)
    verdict = verdict_of(found)
    assert verdict.ends_well.value == 0.0
    assert verdict.trips.value == 1.0
    assert verdict.ends_well.interval == (0.0, interval(0, 3)[1])
    assert "rehearsed on 3 of at most 40 twins" in lines(summary(found))[0]


def test_without_a_rule_an_interval_at_all_draws_is_wider_than_wilsons():
    low, high = interval(30, 40)
    assert low < 0.598 < 0.857 < high
    assert np.isfinite(low)
