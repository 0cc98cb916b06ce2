"""A level that loses its lock is tried once more in a run, by a slower ramp from the level before."""

import rig
from rig.arming.run_options import Silent
from rig.campaigns.plans import load_plan
from tests.recorded import changed, recorded_run

LOCK = {"locked_deg": 4.0, "waiting_deg": 12.0, "lost_deg": 12.0, "lost_periods": 5}
"""A lock that the ramp from 0.3 to 1.5 V loses in 16 periods, and holds in 32."""


def steep(**changes):
    controller = load_plan("magnet-beam/backbone").model_dump(mode="json")["controller"] | {"lock": LOCK}
    return changed(
        "magnet-beam/backbone",
        levels_v=[0.3, 1.5, 2.5],
        ramp_periods=16.0,
        on_lost_lock="skip",
        controller=controller,
        **changes,
    )


class Remarks(Silent):
    def __init__(self):
        self.texts = []

    def remark(self, text):
        self.texts.append(text)


def test_a_level_that_loses_its_lock_is_left_out_with_those_above_by_default():
    run = recorded_run(steep(), seed=1)
    assert [point["quality"] for point in run.recording.latest.values()] == ["warned", "lost-lock"]
    assert len(run.recording.parts) == 1
    assert not run.complete


def test_it_is_tried_once_more_by_a_slower_ramp_and_so_are_those_above(tmp_path):
    remarks = Remarks()
    with rig.run(steep(lost_lock_attempts=2), output=tmp_path / "run.h5", seed=1, progress=remarks) as run:
        points, parts = list(run.recording.latest.values()), run.recording.parts
    assert [point["accepted"] for point in points] == [True, True, True]
    assert [len(point.get("refused_before") or ()) for point in points] == [0, 1, 0]
    assert [point["part"] for point in points] == [0, 1, 1]
    assert points[1]["refused_before"][0]["quality"] == "lost-lock"
    assert len(parts) == 2
    assert run.complete
    assert [text for text in remarks.texts if "once more" in text] == [
        "point 2, 3 once more: from the level before, with ramps of twice the length"
    ]


def test_a_level_that_loses_its_lock_each_time_ends_the_attempts():
    run = recorded_run(steep(lost_lock_attempts=3).model_copy(update={"ramp_periods": 1.0}), seed=1)
    points = list(run.recording.latest.values())
    assert len(run.recording.parts) == 3
    assert (points[1]["quality"], len(points[1]["refused_before"])) == ("lost-lock", 2)
    assert "refused in 3 attempts" in points[1]["reason"]
