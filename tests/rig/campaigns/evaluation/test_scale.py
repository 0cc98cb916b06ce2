"""The scale of a vibration against that of a check, by vibrations made by hand."""

import math

import numpy as np
import pytest

from rig.arming.checked_scale import CheckedScale
from rig.campaigns.evaluation.scale import scale_misfit
from tests.rig.campaigns.made_points import made_point, made_vibration
from tests.rig.rigs import bench_with

HZ, DAMPING = 24.37, 0.004
CHECKED = CheckedScale(
    at="2026-11-27T06:00:00+00:00",
    frequency_hz=HZ,
    damping_ratio=DAMPING,
    acceleration_per_newton=100.0,
    acceleration_per_volt=15.0,
)
BENCH = bench_with()


def point(force=1.0, drive=1.0, amplifier=1.0, damping=1.0, lag_deg=90.0):
    """A vibration at 1 V read by a force and a drive sensor of other sensitivities, behind an amplifier of another gain."""
    motion = 15.0 * amplifier
    harmonics = np.zeros((4, 3), complex)
    turn = np.exp(-1j * math.radians(lag_deg))
    harmonics[:2, 1] = force * damping * motion / 100.0 * turn / abs(math.sin(math.radians(lag_deg))), drive * motion
    return made_point(vibration=made_vibration(harmonics, HZ))


def test_a_rig_as_it_was_checked_has_no_misfit():
    found = scale_misfit(BENCH, point(), CHECKED)
    assert found.factor == pytest.approx(1.0)
    assert not found.warned


@pytest.mark.parametrize("times", [0.1, 0.5, 2.0, 10.0])
@pytest.mark.parametrize(
    ("part", "named"), [("force", "channel force"), ("drive", "channel drive"), ("amplifier", "amplifier")]
)
def test_what_changed_by_a_factor_is_named_warned_of_from_1_5_and_refused_from_3(part, named, times):
    found = scale_misfit(BENCH, point(**{part: times}), CHECKED, at_start=True)
    assert found.factor == pytest.approx(max(times, 1.0 / times))
    assert found.text.startswith(f"{named}: ")
    assert found.warned
    assert found.refused is (max(times, 1.0 / times) >= 3.0)


def test_the_sentence_says_what_was_seen_and_where_to_look():
    assert scale_misfit(BENCH, point(force=0.1), CHECKED, at_start=True).text == (
        "channel force: the drive point moves 10 times as far per newton and 1 times as far per volt as in the last check of "
        "2026-11-27T06:00, refused from a factor 3: look at its sensor, cable and sensitivity_v_per_unit, or the damping has "
        "changed; `rig check` again if the rig was changed"
    )


def test_more_damping_at_a_first_level_is_warned_of_and_goes_on():
    assert scale_misfit(BENCH, point(damping=4.0), CHECKED).warned
    assert not scale_misfit(BENCH, point(damping=4.0), CHECKED).refused
    assert scale_misfit(BENCH, point(damping=6.5), CHECKED).refused
    assert scale_misfit(BENCH, point(damping=4.0), CHECKED, at_start=True).refused
    assert scale_misfit(BENCH, point(damping=0.25), CHECKED).refused


@pytest.mark.parametrize("lag_deg", [45.0, 60.0, 120.0])
def test_another_lag_near_resonance_is_no_misfit(lag_deg):
    assert scale_misfit(BENCH, point(lag_deg=lag_deg), CHECKED).factor == pytest.approx(1.0)


@pytest.mark.parametrize("empty", [{"lag_deg": 10.0}, {"lag_deg": -90.0}, {"force": 0.0}, {"drive": 0.0}])
def test_far_from_resonance_and_without_a_vibration_nothing_is_compared(empty):
    assert scale_misfit(BENCH, point(**empty), CHECKED) is None


def test_a_vibration_that_builds_up_is_compared_with_what_it_becomes():
    rate = DAMPING * 2.0 * math.pi * HZ
    growing, decaying = point(damping=1.4), point(damping=0.6)  # of force per motion, in which the growth is
    assert scale_misfit(BENCH, growing, CHECKED, 0.4 * rate, at_start=True).factor == pytest.approx(1.0)
    assert scale_misfit(BENCH, decaying, CHECKED, -0.4 * rate, at_start=True).factor == pytest.approx(1.0)
    assert scale_misfit(BENCH, point(damping=4.0), CHECKED, 3.0 * rate, at_start=True) is None
