"""What a run has not measured, in one line."""

from rig.campaigns.evaluation.point import Quality
from rig.campaigns.evaluation.skipped import skipped_summary
from tests.rig.campaigns.made_points import made_point


def test_what_was_skipped_is_one_line_with_every_quality_and_place():
    points = [
        made_point(1.0, "N"),
        made_point(2.0, "N", quality=Quality.WARNED),
        made_point(3.0, "N", quality=Quality.NOT_SETTLED),
        made_point(4.0, "N", quality=Quality.UNREACHABLE),
        made_point(5.0, "N", quality=Quality.UNREACHABLE, asked_phase_lag_deg=-150.0),
    ]
    assert skipped_summary(points, 7) == (
        "5 of 7 points skipped: not-settled (3 N); unreachable (4 N, 5 N -150 deg); not tried (2)"
    )
    assert skipped_summary(points[:2], 2) == ""
