"""The stored form of points: what is written is read again, and files of earlier versions are read, too."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rig.campaigns.backbone.points import ShortPointResult
from rig.campaigns.continuous_backbone.points import ContinuousBackboneResult
from rig.campaigns.dwell.points import DwellResult
from rig.campaigns.evaluation.point import PART, Attempt, Point, Quality, RowRange, point_name
from rig.campaigns.evaluation.stored_point import _layout, as_complex, as_pairs, point_from, stored, value_of
from rig.campaigns.kinds import KINDS
from rig.errors import RecordingError
from tests.docs.test_file_format import PLANS
from tests.refused import refused
from tests.rig.campaigns.made_points import made_point, made_vibration

FAILED = {"number": 3, "level": 1.0, "level_unit": "V", "direction": "up", "repeat": 1}
FAILED |= {"settled": False, "accepted": False, "reason": "not settled"}


@pytest.mark.parametrize("name", PLANS)
def test_a_recorded_point_of_every_kind_is_read_and_written_as_it_was(name):
    import rig
    from rig.campaigns.plans import plan_from

    plan = plan_from(PLANS[name], name)
    with rig.run(plan) as run:
        table = run.recording.parts[0].points[0]
    assert table["accepted"]
    point = point_from(table, KINDS[plan.kind].result)
    again = stored(point)
    assert again.keys() == table.keys()
    assert json.dumps(again, sort_keys=True) == json.dumps(table, sort_keys=True)


def test_a_point_that_failed_holds_no_data_and_is_written_without_any():
    point = point_from({**FAILED, "quality": "not-settled"})
    assert not point.accepted
    assert point.vibration is point.rows is point.warnings is None
    assert stored(point) == {**FAILED, "quality": "not-settled"}


@pytest.mark.parametrize(
    ("told", "quality"),
    [
        ({"accepted": True}, Quality.GOOD),
        ({"accepted": True, "warnings": ["one"]}, Quality.WARNED),
        ({"accepted": False}, Quality.REJECTED),
        ({"accepted": False, "quality": "of a later version"}, Quality.REJECTED),
        ({"accepted": True, "quality": "rejected"}, Quality.GOOD),
        ({"accepted": False, "quality": "lost-lock"}, Quality.LOST_LOCK),
    ],
)
def test_the_quality_of_files_of_earlier_and_later_versions_follows_from_what_is_accepted(told, quality):
    assert point_from({**FAILED, **told}).quality is quality


def test_keys_that_an_earlier_version_did_not_write_are_none_and_unknown_ones_are_ignored():
    table = stored(made_point(vibration=made_vibration(np.ones((2, 3), complex)))) | {"of_a_later_version": 1}
    del table["power_indicator"], table["harmonic_power"], table["drift"]
    point = point_from(table)
    assert point.vibration.purity.power_indicator is None
    assert point.spectrum.drift is None
    np.testing.assert_array_equal(point.spectrum.harmonics, np.ones((2, 3)))


def test_a_point_without_a_number_is_refused():
    with refused(RecordingError, "point-number-is-missing"):
        point_from({"accepted": True})


def test_pairs_are_complex_numbers():
    values = np.array([[1 + 2j, -3j], [0.5, 0.0]])
    np.testing.assert_array_equal(as_complex(as_pairs(values)), values)


def names_of(*kinds):
    """The names of all fields of dataclasses and of their parts."""
    for kind in kinds:
        for one, inner, _ in _layout(kind):
            yield from names_of(inner) if one.metadata == PART and inner is not None else (one.name,)


@pytest.mark.parametrize("kind", KINDS)
def test_every_column_of_a_kind_is_a_field_of_its_points(kind):
    names = {*names_of(Point, KINDS[kind].result)}
    assert {column.key for column in KINDS[kind].columns} <= names


def test_a_value_is_found_in_the_part_that_has_it():
    point = made_point(2.0, vibration=made_vibration(), result=DwellResult(cycles=7.0))
    assert [value_of(point, name) for name in ("level", "force_n", "force_purity", "cycles")] == [2.0, 1.0, 1.0, 7.0]
    assert value_of(point, "frequency_change") is None
    assert value_of(made_point(), "force_n") is None


def test_the_names_of_a_part_do_not_hide_those_of_all_points():
    for result in (ShortPointResult, ContinuousBackboneResult, *(campaign.result for campaign in KINDS.values())):
        assert {"number", "level", "quality", "warnings"}.isdisjoint(names_of(result))


def test_people_count_points_from_one():
    assert point_name(0) == "point 1"


def test_refused_attempts_are_stored_with_their_point_and_read_again():
    first = Attempt(
        reason="outputs came too late: held in 14 samples",
        quality=Quality.REJECTED,
        rows=RowRange(first_sample=10, end_sample=30),
        part=0,
        frequency_hz=24.4,
        force_n=0.1,
    )
    second = Attempt(reason="the settle rule was broken while recording", quality=Quality.DISTURBED)
    table = stored(made_point(refused_before=(first, second)))
    assert table["refused_before"][0]["end_sample"] == 30
    assert table["refused_before"][1] == {"reason": second.reason, "quality": "disturbed"}
    point = point_from(json.loads(json.dumps(table)))
    assert point.refused_before == (first, second)
    assert point.attempts == 3
    assert isinstance(point.refused_before[0].quality, Quality)


def test_a_key_that_has_another_name_today_is_read():
    table = stored(replace(made_point(), nonharmonic_force=0.02))
    table["alien_force"] = table.pop("nonharmonic_force")
    assert point_from(table).nonharmonic_force == 0.02


def test_a_point_without_refused_attempts_is_stored_as_in_earlier_versions():
    assert "refused_before" not in stored(made_point())
    assert point_from({**FAILED, "quality": "not-settled"}).attempts == 1
