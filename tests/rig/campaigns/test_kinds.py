"""Every kind of campaign is declared whole, in its own folder."""

from pkgutil import resolve_name

import pytest

from identification import Backbone, FrequencyResponse
from rig.campaigns.kinds import KINDS, kinds_that_yield
from rig.campaigns.plans import bench_of, load_plan, shipped_plans


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_kind_names_exists(kind):
    campaign = KINDS[kind]
    assert callable(resolve_name(campaign.draw))
    assert campaign.draw.startswith(f"rig.campaigns.{kind.replace('-', '_')}.")
    assert campaign.measurements
    for path in (*campaign.identity, *campaign.fixed):
        assert path.split(".")[0] in campaign.plan.model_fields


def test_every_kind_has_a_shipped_plan():
    assert {load_plan(name).kind for name in shipped_plans()} == set(KINDS)


def test_kinds_are_found_by_what_they_yield():
    assert set(kinds_that_yield(FrequencyResponse)) == {"stepped-sine", "stepped-phase", "response-controlled"}
    assert set(kinds_that_yield(Backbone)) == {"backbone", "continuous-backbone", "decay", "response-controlled"}


@pytest.mark.parametrize("name", shipped_plans())
def test_a_plan_whose_points_are_all_done_has_no_segments_left(name):
    plan = load_plan(name)
    done = frozenset(target.number for target in plan.targets())
    assert plan.segments(bench_of(plan, name).sample_rate_hz, done) == ()
