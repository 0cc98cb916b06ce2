"""What the device says of a point's samples, and when it spoils the point."""

import numpy as np
import pytest

from rig.campaigns.evaluation.point import Quality
from rig.campaigns.running.device_remarks import with_device_remarks, with_disorder
from rig.tick.layout import DEVICE_SHIFT, SAMPLE_LOST, recorded_row
from tests.rig.campaigns.made_points import made_point

COUNTERS = ("overload", "output_clipped", "output_held", "output_continued", *(f"counter_{n}" for n in range(4, 22)))


def rows_with(flag: int, count: int, size: int = 1000) -> np.ndarray:
    rows = np.zeros(size, recorded_row(2))
    rows["flags"][:count] = flag
    return rows


@pytest.mark.parametrize(("held", "accepted"), [(0, True), (50, True), (51, False)])
def test_a_point_with_more_than_a_twentieth_of_its_outputs_held_is_not_accepted(held: int, accepted: bool) -> None:
    rows = rows_with(1 << (DEVICE_SHIFT + 2), held)
    point = with_device_remarks(made_point(warnings=("before",)), rows, COUNTERS)
    assert point.accepted is accepted
    assert point.warnings[0] == "before"
    assert (f"output held in {held} of 1000 samples" in point.warnings) is (held > 0)
    if not accepted:
        assert point.reason.startswith(
            "outputs came too late: held in 51 samples of 1000, `rig doctor --daq` recommends"
        )


@pytest.mark.parametrize(("continued", "accepted"), [(0, True), (250, True), (251, False)])
def test_outputs_that_the_device_continued_are_counted_and_spoil_a_point_above_a_quarter(
    continued: int, accepted: bool
) -> None:
    point = with_device_remarks(made_point(), rows_with(1 << (DEVICE_SHIFT + 3), continued), COUNTERS)
    assert point.accepted is accepted
    assert point.continued_samples == continued
    assert point.warnings == ()
    if not accepted:
        assert point.reason.startswith("outputs came too late: continued in 251 samples of 1000, ")
        assert point.reason.endswith("; allowed is up to 25%")


def test_a_point_that_failed_for_another_reason_keeps_it_behind_the_outputs_that_were_held() -> None:
    refused = made_point(quality=Quality.REJECTED, reason="another mode")
    point = with_device_remarks(refused, rows_with(1 << (DEVICE_SHIFT + 2), 7), COUNTERS)
    assert point.reason.startswith("outputs came too late: held in 7 samples of 1000, ")
    assert point.reason.endswith("; another mode")
    point = with_device_remarks(refused, rows_with(1 << DEVICE_SHIFT, 7), COUNTERS)
    assert point.reason == "another mode"


def test_overloads_warn_and_lost_samples_are_counted() -> None:
    point = with_device_remarks(made_point(), rows_with(1 << DEVICE_SHIFT, 3), COUNTERS)
    assert point.accepted
    assert point.warnings == ("overload in 3 of 1000 samples",)
    point = with_device_remarks(made_point(), rows_with(SAMPLE_LOST, 7), COUNTERS)
    assert point.lost_samples == 7
    assert point.warnings == ("7 of 1000 samples were lost in transmission",)


LATE = {"lost_samples": 9, "late_blocks": 3, "reordered_blocks": 0, "out_of_order_frames": 3}


def test_where_blocks_came_too_late_for_their_place_the_order_is_named() -> None:
    said = "frames arrive out of order: 3 frames after a later one, 3 blocks too late"
    point = with_device_remarks(made_point(), rows_with(SAMPLE_LOST, 7), COUNTERS)
    accepted = with_disorder(point, LATE)
    assert accepted.accepted
    assert accepted.warnings[-1].startswith(said)
    refused = with_disorder(point.refused("7 of 1000 samples were lost in transmission"), LATE)
    assert refused.reason.startswith(f"7 of 1000 samples were lost in transmission; {said}")
    assert with_disorder(point, LATE | {"late_blocks": 0}) == point
    assert "1 frames too late" in with_disorder(point, LATE | {"late_blocks": 0, "late_frames": 1}).warnings[-1]
    failed = made_point(quality=Quality.REJECTED, reason="7 of 9 samples were lost in transmission")
    assert with_disorder(failed, LATE).reason.startswith(f"{failed.reason}; {said}")
    whole = with_device_remarks(made_point(), rows_with(0, 0), COUNTERS)
    assert with_disorder(whole, LATE) == whole
