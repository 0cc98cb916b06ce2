"""Warnings of points: in short beside a point, once for all points that have the same, with the range of their numbers."""

from dataclasses import replace

import pytest

from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.evaluation.point import Quality, planned_point
from rig.show.point_warnings import (
    in_short,
    points_named,
    quality_in_short,
    warnings_together,
    what_warnings_mean,
)
from tests.rig.rigs import preset

PLAN = BackbonePlan.model_validate(
    {"bench": "magnet-beam", "controller": preset("magnet-beam").model_dump(), "levels_v": (0.4,)}
)


def warned(number, *warnings):
    point = planned_point(PLAN, PLAN.targets()[0])
    return replace(point, number=number, quality=Quality.WARNED, warnings=warnings)


def bias(number, percent):
    return warned(number, f"force harmonics (damping ±{percent} %): damping is {percent} % lower (warning above 1 %)")


def test_the_short_form_is_what_stands_before_the_colon():
    assert in_short("force of 9.6 converter steps: rounding") == "force of 9.6 converter steps"
    assert in_short("3 of 90 samples were lost") == "3 of 90 samples were lost"
    assert quality_in_short(warned(0, "a: 1", "b: 2", "a: 3")) == "warned: a, b"
    good = planned_point(PLAN, PLAN.targets()[0])
    assert quality_in_short(good) == "good"
    assert quality_in_short(good.refused("why")) == "rejected"


def test_equal_warnings_are_one_line_with_the_points_and_the_range_of_each_number():
    points = [warned(0, "force of 9.6 converter steps: rounding"), bias(6, 1.5), bias(7, 10.2), bias(8, 9.2)]
    assert warnings_together(points) == [
        "point 1: force of 9.6 converter steps: rounding",
        "points 7 to 9: force harmonics (damping ±1.5 to 10.2 %): damping is 1.5 to 10.2 % lower (warning above 1 %)",
    ]


def test_numbers_of_harmonics_and_names_with_digits_are_kept_apart():
    points = [warned(0, "harmonic 2 of acc1 off by 3 %"), warned(1, "harmonic 3 of acc1 off by 4 %")]
    points += [warned(2, "harmonic 3 of acc2 off by 4 %"), warned(3, "harmonic 3 of acc2 off by -5 %")]
    assert warnings_together(points) == [
        "point 1: harmonic 2 of acc1 off by 3 %",
        "point 2: harmonic 3 of acc1 off by 4 %",
        "points 3 and 4: harmonic 3 of acc2 off by 4 to -5 %",
    ]


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([0], "point 1"),
        ([4, 3], "points 4 and 5"),
        ([0, 1, 6, 7, 8], "points 1, 2 and 7 to 9"),
        ([0, 1, 2], "points 1 to 3"),
        ([0, 2, 4], "points 1, 3 and 5"),
        ([3, 3], "point 4"),
    ],
)
def test_points_are_named_in_runs(numbers, text):
    assert points_named(numbers) == text


def test_a_plan_without_harmonics_is_named_only_where_harmonics_were_warned_of():
    assert what_warnings_mean([planned_point(PLAN, PLAN.targets()[0])], "PURE") == ""
    assert "PURE" not in what_warnings_mean([warned(0, "force of 9.6 converter steps: rounding")], "PURE")
    assert what_warnings_mean([bias(0, 2.0)], "PURE").endswith("; PURE")
    assert what_warnings_mean([bias(0, 2.0).refused("why")], "PURE") == ""
