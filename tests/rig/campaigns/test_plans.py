"""Plans from tables of any version."""

from rig.campaigns.plans import load_plan, plan_from
from rig.errors import ConfigurationError
from tests.refused import refused


def test_a_plan_of_an_earlier_version_keeps_what_its_key_said():
    table = load_plan("magnet-beam/backbone").model_dump(mode="json", exclude_unset=True)
    table |= {"kind": "backbone", "accepted_alien_force": 0.03}
    assert plan_from(table, "here").accepted_nonharmonic_force == 0.03


def test_an_unknown_kind_is_refused_with_those_that_there_are():
    with refused(ConfigurationError, field="kind", value="backbones"):
        plan_from({"kind": "backbones"}, "here")
