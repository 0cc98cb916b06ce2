"""What is said of a trip: the likeliest cause from the points before, and what to do; polarity only where it can be that."""

import math

import pytest

from rig.bench import load_bench
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.plans import load_plan
from rig.campaigns.running.trip_advice import Before, Trip, advice_on
from rig.campaigns.running.tripped_level import TrippedAt
from rig.tick.safety.layout import POLARITY_HINT, EndReason
from tests.rig.campaigns.evaluation.test_vibration_quality import vibration
from tests.rig.campaigns.made_points import made_point, made_vibration

BENCH = load_bench("magnet-beam")
PLAN = load_plan("magnet-beam/backbone").model_copy(
    update={"levels_v": None, "levels_n": (2.0, 4.0, 8.0), "start_v": 0.4}
)
DRIVE, TIP, HZ = 1, 3, 24.37
AT_8_N = TrippedAt(8.0, "N", start=False)


def point(level, tip_m, force_n=1.0):
    """A point whose tip has moved so far, in a pure sine."""
    measured = vibration([force_n], [-1j * tip_m / 1.6], HZ).harmonics.copy()
    measured[TIP, 1] = (2 * math.pi * HZ) ** 2 * tip_m
    return made_point(level, "N", vibration=made_vibration(measured, HZ))


def said(reason, channel=TIP, *, points=(), locked=True, first=False, at=AT_8_N, hz=HZ, plan=PLAN):
    return advice_on(Trip(reason, channel, hz), BENCH, plan, at, Before(points, locked, first))


def test_a_level_that_the_points_before_lead_to_expect_beyond_the_limit_is_too_high_and_the_highest_that_fits_is_said():
    points = [point(2.0, 0.0022), point(4.0, 0.78 * 0.006)]
    cause, remedy = said(EndReason.DISPLACEMENT_LIMIT, points=points)
    expected = "the point before, 4 N, had reached 78 % of limits.displacement_m on channel acc_magnet"
    assert cause == f"{expected}: the level 8 N is too high"
    assert remedy.startswith("lower levels_n below 4.6 N, or raise limits.displacement_m = 0.006")


def test_a_level_that_the_points_before_lead_to_expect_far_below_the_limit_is_not_blamed():
    cause, remedy = said(EndReason.DISPLACEMENT_LIMIT, points=[point(4.0, 0.1 * 0.006)])
    assert "had reached 10 % of limits.displacement_m on channel acc_magnet" in cause
    assert "alone does not explain it" in cause
    assert "force, drive and channel acc_magnet" in remedy


@pytest.mark.parametrize(
    ("reason", "channel", "key"),
    [
        (EndReason.FORCE_LIMIT, 0, "limits.force_n"),
        (EndReason.RESPONSE_LIMIT, TIP, "limits.acceleration_m_s2"),
        (EndReason.OVERTRAVEL, TIP, "limits.displacement_m"),
        (EndReason.SENSOR_OVERLOAD, TIP, "the range of 490.2 m/s^2"),
    ],
)
def test_the_margin_is_that_of_the_limit_that_tripped(reason, channel, key):
    cause, _ = said(reason, channel, points=[point(7.9, 0.0055, force_n=39.0)])
    assert f"% of {key} on channel {BENCH.channels[channel].name}" in cause


@pytest.mark.parametrize("reason", [r for r in EndReason if r.is_trip])
def test_every_trip_has_a_cause_and_a_remedy(reason):
    for points in ((), [point(4.0, 0.001)]):
        for at in (None, AT_8_N, TrippedAt(0.4, "V", start=True)):
            assert all(said(reason, -1 if reason >= EndReason.DRIVER_FAILED else TIP, points=points, at=at))


def test_polarity_is_asked_for_where_no_lock_was_ever_gained_or_the_first_point_trips():
    reason = EndReason.DISPLACEMENT_LIMIT
    assert POLARITY_HINT in said(reason, locked=False).likely_cause
    assert "polarity" in said(reason, first=True).likely_cause
    assert "polarity" not in said(reason).likely_cause
    assert "polarity" not in said(reason, points=[point(4.0, 0.005)]).likely_cause
    multisine = MultisinePlan.model_validate(
        {"bench": "magnet-beam", "levels_rms_v": (0.1,), "lowest_hz": 22, "highest_hz": 28, "resolution_hz": 0.5}
    )
    assert POLARITY_HINT not in said(reason, locked=False, plan=multisine, at=None).likely_cause


@pytest.mark.parametrize(
    ("hz", "what"), [(26.8, "frequency_window_hz"), (21.95, "frequency_window_hz"), (24.5, "knock")]
)
def test_a_lock_that_broke_at_an_end_of_its_window_is_told_from_one_that_broke_within(hz, what):
    assert what in said(EndReason.LOST_LOCK, -1, hz=hz, points=[point(4.0, 0.003)]).likely_cause


def test_a_start_that_trips_lowers_the_start_voltage():
    assert "lower start_v" in said(EndReason.FORCE_LIMIT, 0, at=TrippedAt(0.4, "V", start=True)).what_to_do


@pytest.mark.parametrize("reason", [EndReason.OVER_LEVEL, EndReason.GAIN_CHANGED])
def test_what_is_held_and_its_output_do_not_fit_blames_the_channel_and_the_amplifier(reason):
    cause, remedy = said(reason, 0)
    assert "channel force" in cause
    assert "amplifier" in cause
    assert "`rig check`" in remedy
