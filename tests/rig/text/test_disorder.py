"""Frames out of order, in words."""

import pytest

from rig.text.disorder import disorder_text

WHO = " (adapter, its firmware or its driver)"


@pytest.mark.parametrize(
    ("counters", "said"),
    [
        ({}, ""),
        ({"out_of_order_frames": 0, "reordered_blocks": 0, "late_blocks": 0, "lost_samples": 7}, ""),
        ({"out_of_order_frames": 3}, "3 frames after a later one, 0 blocks put in their place"),
        ({"reordered_blocks": 2}, "2 blocks put in their place"),
        ({"late_blocks": 1}, "1 blocks too late for their place, and lost"),
        (
            {"out_of_order_frames": 2, "late_frames": 1},
            "2 frames after a later one, 1 frames too late for their block, which is lost",
        ),
        (
            {"out_of_order_frames": 9, "reordered_blocks": 2, "late_blocks": 1},
            "9 frames after a later one, 2 blocks put in their place, 1 blocks too late for their place, and lost",
        ),
    ],
)
def test_counters_of_frames_out_of_order_are_one_line(counters: dict[str, int], said: str) -> None:
    assert disorder_text(counters) == (f"frames arrive out of order: {said}{WHO}" if said else "")
