"""A point that failed because outputs were held or samples lost says that, with the count and the remedy."""

import math

import numpy as np
import pytest

from rig.campaigns.evaluation.device_faults import DISTURBED, DeviceFaults, pages_on, why_disturbed
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.evaluation.vibrations import failed_point
from rig.campaigns.plans import load_plan
from rig.tick.sequencer.layout import OUTCOME, Outcome

PLAN = load_plan("magnet-beam/backbone")


def failed(outcome, held=0, lost=0, samples=2000, continued=0):
    entry = np.zeros(1, OUTCOME)[0]
    entry["outcome"], entry["held"], entry["lost"], entry["continued"] = outcome, held, lost, continued
    entry["first_sample"], entry["end_sample"] = 5000, 5000 + samples
    entry["mean_error_rad"] = math.radians(3.0)
    return failed_point(PLAN, PLAN.targets()[0], entry)


def test_a_record_with_held_outputs_says_how_many_and_what_helps():
    point = failed(Outcome.DISTURBED, held=14)
    assert point.quality is Quality.DISTURBED
    assert point.reason.startswith(
        "outputs came too late: held in 14 samples of 2000, `rig doctor --daq` recommends a queue"
    )
    assert "averaged phase error 3.00 deg" in point.reason
    assert DISTURBED not in point.reason


def test_a_disturbance_without_faults_of_the_device_keeps_its_words():
    assert failed(Outcome.DISTURBED).reason.startswith(f"{DISTURBED} (averaged phase error 3.00 deg")
    assert pages_on(failed(Outcome.DISTURBED).reason) == []


@pytest.mark.parametrize(("lost", "spoilt"), [(1, False), (100, False), (101, True)])
def test_lost_samples_are_the_reason_above_a_twentieth_and_told_below(lost, spoilt):
    reason = failed(Outcome.DISTURBED, lost=lost).reason
    assert reason.startswith(f"{lost} of 2000 samples were lost") is spoilt
    assert (DISTURBED in reason) is not spoilt
    assert pages_on(reason) == ["samples-lost"]


def test_a_point_that_did_not_settle_while_outputs_were_held_says_both():
    reason = failed(Outcome.NOT_SETTLED, held=300).reason
    assert reason.startswith("not settled within 600 periods; outputs came too late: held in 300 samples of 2000")
    assert pages_on(reason) == ["held-outputs"]


def test_a_level_out_of_reach_is_not_put_down_to_the_device():
    assert "too late" not in failed(Outcome.UNREACHABLE, held=300).reason


def test_an_attempt_that_is_measured_again_needs_no_remedy():
    assert DeviceFaults(14, 0, 3, 2000).text(final=False) == (
        "outputs came too late: held in 14 samples of 2000, 3 of 2000 samples were lost in transmission"
    )
    both = DeviceFaults(14, 30, 0, 2000)
    assert both.text(final=False) == "outputs came too late: held in 14 and continued in 30 samples of 2000"
    assert "doctor" not in why_disturbed(both, final=False)
    assert "doctor" in why_disturbed(both)


@pytest.mark.parametrize(("continued", "spoilt"), [(500, False), (501, True)])
def test_continued_outputs_explain_a_disturbance_above_a_quarter_of_the_record(continued, spoilt):
    reason = failed(Outcome.DISTURBED, continued=continued).reason
    assert (DISTURBED in reason) is not spoilt
    assert f"continued in {continued} samples of 2000" in reason


@pytest.mark.parametrize(
    ("outcome", "faults", "said"),
    [
        (Outcome.OUTPUT_HELD, {"held": 101}, "outputs came too late: held in 101 samples of 2000"),
        (Outcome.OUTPUT_CONTINUED, {"continued": 501}, "outputs came too late: continued in 501 samples of 2000"),
        (Outcome.SAMPLES_LOST, {"lost": 101}, "101 of 2000 samples were lost in transmission"),
    ],
)
def test_a_record_that_was_given_up_for_the_device_is_rejected_for_it(outcome, faults, said):
    point = failed(outcome, **faults)
    assert point.quality is Quality.REJECTED
    assert point.reason.startswith(f"{said}, `rig doctor --daq`")
    assert "; allowed is up to " in point.reason


def test_nothing_is_said_of_nothing():
    assert DeviceFaults(samples=100).text() == ""
    assert why_disturbed(DeviceFaults(samples=100), " (x)") == f"{DISTURBED} (x)"
