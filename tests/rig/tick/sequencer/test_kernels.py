"""The settle rule and the walk through the segments, period by period."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from controller import AmplitudeLaw, LockRule, LockState
from controller.kernels import LOCK, MOST_LAG_SLOWING, PERIOD, STEEP_PERIODS, next_lock_state
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.safety.limits import guard_record
from rig.tick.sequencer.judgement import SETTLING, forget_periods, judge_period
from rig.tick.sequencer.kernels import NEAR_PERIODS, advance
from rig.tick.sequencer.layout import PROGRESS, OnFailure, Outcome, SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule, segment_table
from vibrolock.compiled import bound

RULE = SettleRule(phase_deg=1.0, amplitude=0.01, average_periods=5, settled_periods=8)


def _judge(periods, locked=True, wanted_force=0.0, saturated=False, open_loop=False, distortion=0.0):
    settling = np.zeros(1, SETTLING)
    rule, period = RULE.build(), np.zeros(1, PERIOD)
    period["saturated"] = saturated
    for error_deg, response, force in periods:
        period["error_rad"], period["drive_m_s2"] = math.radians(error_deg), response
        period["force_n"] = period["held"] = force
        judge_period(settling[0], rule[0], period[0], wanted_force, locked, open_loop, distortion)
    return settling[0]


def test_a_quiet_vibration_settles_after_twice_the_average_and_the_settled_periods():
    assert _judge([(0.5, 1.0, 1.0)] * (2 * 5 + 8 - 2))["good_periods"] == 7
    assert _judge([(0.5, 1.0, 1.0)] * (2 * 5 + 8 - 1))["good_periods"] == 8


def test_only_the_averaged_error_counts():
    swinging = [(20.0 * (-1) ** k, 1.0, 1.0) for k in range(40)]
    assert _judge(swinging)["good_periods"] == 0  # five periods of +-20 deg average to +-4 deg
    fast = [(20.0 * math.cos(2 * math.pi * k / 5), 1.0, 1.0) for k in range(40)]
    assert _judge(fast)["good_periods"] > 8


@given(st.floats(0.0021, 0.1))
def test_a_drifting_amplitude_does_not_settle(rate):
    assert _judge([(0.0, (1.0 + rate) ** k, 1.0) for k in range(60)])["good_periods"] == 0


@given(st.floats(0.0, 0.0019))
def test_a_slow_enough_drift_does(rate):
    assert _judge([(0.0, (1.0 + rate) ** k, 1.0) for k in range(60)])["good_periods"] > 8


def test_nothing_settles_without_a_lock():
    assert _judge([(0.0, 1.0, 1.0)] * 100, locked=False)["good_periods"] == 0


def test_harmonics_beyond_their_tolerance_keep_a_steady_vibration_from_settling():
    quiet = [(0.5, 1.0, 1.0)] * 60
    for distortion in (1.01, math.inf):
        unsettled = _judge(quiet, distortion=distortion)
        assert (unsettled["good_periods"], unsettled["steady"]) == (0, 1)
    assert _judge(quiet, distortion=0.99)["good_periods"] > 8
    assert _judge(quiet, locked=False)["steady"] == 0
    assert _judge([(20.0, 1.0, 1.0)] * 60)["steady"] == 0


def test_a_force_level_must_be_reached():
    assert _judge([(0.0, 1.0, 0.98)] * 60, wanted_force=1.0)["good_periods"] == 0
    assert _judge([(0.0, 1.0, 0.995)] * 60, wanted_force=1.0)["good_periods"] > 8


def test_periods_before_the_level_was_reached_do_not_count():
    settling = np.ones(1, SETTLING)
    forget_periods(settling[0])
    for name in ("count", "steady", "good_periods", "bad_periods", "saturated_periods", "clamped_periods"):
        assert settling[name] == 0
    assert np.isnan([settling["mean_error_rad"], settling["drift"]]).all()


def test_a_level_that_saturates_and_is_not_reached_is_counted():
    assert _judge([(0.0, 1.0, 0.9)] * 60, wanted_force=1.0, saturated=True)["saturated_periods"] > 20
    assert _judge([(0.0, 1.0, 0.995)] * 60, wanted_force=1.0, saturated=True)["saturated_periods"] == 0


@pytest.mark.parametrize(
    ("clamped", "in_row", "judged"),
    [
        ([1] * 9, 9, 0),  # the rule judges from twice the average of five periods on
        ([1] * 10, 10, 1),
        ([1] * 35, 35, 26),
        ([1] * 34 + [0], 0, 0),
        ([1] * 30 + [0] + [1] * 4, 4, 4),
        ([0] * 5 + [1] * 7, 7, 3),
        ([0] * 40, 0, 0),
    ],
)
def test_periods_with_a_clamped_frequency_are_counted_in_a_row(clamped, in_row, judged):
    settling, rule, period = np.zeros(1, SETTLING), RULE.build(), np.zeros(1, PERIOD)
    for one in clamped:
        period["clamped"] = one
        judge_period(settling[0], rule[0], period[0], 0.0, True, False, 0.0)
    assert (settling[0]["clamped_in_row"], settling[0]["clamped_periods"]) == (in_row, judged)


class Walk:
    """A sequencer without a rig: cycles are dealt out by hand."""

    def __init__(self, *segments):
        self.table, self.outcomes = segment_table(segments, 5000.0)
        self.progress = np.zeros(1, PROGRESS)
        self.progress["segments"] = len(segments)
        self.settling, self.lock, self.guard = np.zeros(1, SETTLING), np.zeros(1, LOCK), guard_record(True)
        self.lock["state"] = LockState.LOCKED
        self.cycle, self.sample, self.levels, self.lags = 0.0, 0, [], []

    def go(self, periods, per_period=50, unreached=False):
        self.progress["unreached"] = unreached
        records = self.settling[0], RULE.build()[0], self.lock[0], self.guard[0]
        given = (self.progress[0], self.table, self.outcomes, *records)
        advanced = bound(advance, *given)
        for _ in range(int(periods * per_period)):
            self.progress["cycle"], self.progress["sample"] = self.cycle, self.sample
            advanced(*given)
            self.levels.append(float(self.progress["level"][0]))
            self.lags.append(float(self.progress["lag"][0]))
            self.cycle += 1.0 / per_period
            self.sample += 1
        return self

    def go_to_the_next(self):
        """Go on until the next segment has begun."""
        segment = int(self.progress["segment"][0])
        while self.progress["segment"][0] == segment:
            self.go(0.02)
        return self.go(0.02)

    def codes(self):
        return [Outcome(int(code)).name for code in self.outcomes["outcome"]]


def _point(number, level, on_failure=OnFailure.SKIP, on_lost_lock=OnFailure.STOP):
    return (
        Segment(SegmentKind.RAMP, number, level, 10.0),
        Segment(SegmentKind.SETTLE, number, level, 30.0, on_failure, on_lost_lock),
        Segment(SegmentKind.RECORD, number, level, 20.0, on_failure, on_lost_lock),
    )


def test_a_ramp_is_half_a_cosine_between_the_levels():
    walk = Walk(Segment(SegmentKind.HOLD, -1, 1.0, 1.0), Segment(SegmentKind.RAMP, 0, 3.0, 10.0)).go(13)
    ramp = np.array(walk.levels[50:550])
    expected = 1.0 + 2.0 * 0.5 * (1 - np.cos(np.pi * np.arange(ramp.size) / ramp.size))
    np.testing.assert_allclose(ramp[5:-5], expected[5:-5], atol=2.0 * np.pi / 500 * 3)
    assert max(np.abs(np.diff(walk.levels[60:]))) < 0.02


def _held(level, periods, **keys):
    return Segment(SegmentKind.HOLD, -1, level, periods, amplitude_law=AmplitudeLaw.RESPONSE, **keys)


def _ramp(level, periods, point=-1, **keys):
    return Segment(SegmentKind.RAMP, point, level, periods, amplitude_law=AmplitudeLaw.RESPONSE, **keys)


def test_a_geometric_ramp_is_half_a_cosine_of_the_logarithm_and_never_leaves_its_ends():
    walk = Walk(_held(1e-5, 1.0), _ramp(1e-3, 10.0, geometric=True)).go(12)
    ramp = np.array(walk.levels[51:551])
    expected = -5 + 2.0 * 0.5 * (1 - np.cos(np.pi * np.arange(ramp.size) / ramp.size))
    np.testing.assert_allclose(np.log10(ramp), expected, atol=2e-2)
    assert 1e-5 <= ramp.min() <= ramp.max() <= 1e-3


def test_from_rest_a_geometric_ramp_is_a_plain_one():
    walk = Walk(_ramp(2.0, 10.0, geometric=True)).go(10)
    assert walk.levels[250] == pytest.approx(1.0, abs=0.02)


def test_the_wanted_lag_is_ramped_with_the_level_and_then_held():
    start, end = math.radians(-150.0), math.radians(-30.0)
    segments = (_held(1.0, 1.0, lag_deg=-150.0), _ramp(1.0, 10.0, lag_deg=-30.0), _held(1.0, 5.0, lag_deg=-30.0))
    walk = Walk(*segments).go(15)
    ramp = np.array(walk.lags[51:551])
    expected = start + (end - start) * 0.5 * (1 - np.cos(np.pi * np.arange(ramp.size) / ramp.size))
    np.testing.assert_allclose(ramp, expected, atol=0.02)
    assert walk.lags[-1] == pytest.approx(end)


def test_a_ramp_up_waits_while_its_level_is_not_reached_and_goes_on_where_it_was():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0)).go(6)
    waiting = walk.levels[-1]
    walk.go(15, unreached=True)
    assert walk.levels[-1] == pytest.approx(waiting, abs=0.02)
    walk.go(4.9)
    assert waiting < walk.levels[-1] <= 3.0
    walk.go(1)
    assert walk.codes() == ["DONE", "DONE"]
    assert walk.outcomes["periods"][1] == pytest.approx(25.0, abs=0.1)


def test_a_ramp_up_that_waits_for_twenty_periods_is_out_of_reach_and_skips_its_point():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0, point=0), *_point(1, 2.0)).go(6).go(21, unreached=True)
    assert walk.codes()[:3] == ["DONE", "UNREACHABLE", "RUNNING"]


def test_a_ramp_up_waits_while_the_phase_of_a_locked_loop_is_off():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0)).go(6)
    waiting = walk.levels[-1]
    walk.lock["slowing"] = 1
    walk.go(15)
    assert walk.levels[-1] == pytest.approx(waiting, abs=0.02)
    assert walk.progress["waited_cycles"][0] == pytest.approx(15.0, abs=0.1)
    walk.lock["slowing"] = 0
    walk.go(5.9)
    assert walk.codes() == ["DONE", "DONE"]
    assert walk.levels[-1] == 3.0


def test_a_ramp_up_is_slower_in_proportion_to_its_phase_error():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0))
    walk.lock["slowing"] = 0.75
    assert walk.go(40.9).codes() == ["DONE", "RUNNING"]
    assert walk.go(0.2).codes() == ["DONE", "DONE"]


def _with_lag(walk, lag):
    """Let the lag of the ramp under way be ``lag`` times the one from which it is slower, then none any more."""
    thresholds = LockRule().build()[0]
    for error_rad in (lag * 0.5 * thresholds["waiting_rad"], 0.0):
        next_lock_state(walk.lock[0], thresholds, True, False, error_rad, True)
    assert walk.lock["slowing"] == 0.0


def test_a_ramp_up_stays_so_much_slower_that_its_lag_would_not_come_again():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0)).go(6)
    _with_lag(walk, 4.0)  # of half a ramp: what is left takes four times as long
    assert walk.go(20.9 - 1.0).codes() == ["DONE", "RUNNING"]
    assert walk.go(1.2).codes() == ["DONE", "DONE"]


def test_the_next_ramp_up_begins_at_the_rate_that_the_lag_of_the_one_before_allows():
    def rates(*lags):
        walk = Walk(_held(1.0, 1.0), *(_ramp(3.0 + k, 10.0) for k in range(len(lags) + 1))).go(2)
        for lag in lags:
            _with_lag(walk, lag)
            walk.go_to_the_next()
        return 1.0 - float(walk.lock["lag_slowing"][0])

    assert rates(1.0) == 1.0
    assert rates(2.0) == pytest.approx(0.5)
    assert rates(2.0, 0.8) == pytest.approx(0.5 / 0.8)
    assert rates(2.0, 2.0) == pytest.approx(0.25)
    assert rates(2.0, 0.4) == 1.0
    assert rates(100.0) == pytest.approx(1.0 - MOST_LAG_SLOWING)


@pytest.mark.parametrize("fault", ["held", "continued", "lost"])
def test_a_lag_that_a_fault_of_the_device_has_made_slows_no_ramp(fault):
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0), _ramp(4.0, 10.0)).go(2)
    walk.progress[fault] = 3
    _with_lag(walk, 4.0)
    walk.go_to_the_next()
    assert walk.progress["slowed_cycles"][0] == 0.0
    assert walk.lock["lag_slowing"][0] == 0.0


def test_before_the_first_lock_no_ramp_waits_for_the_phase():
    walk = Walk(_ramp(3.0, 10.0))
    walk.lock["state"], walk.lock["slowing"], walk.progress["unlocked"] = LockState.ACQUIRING, 1, 1
    assert walk.go(10.1).codes() == ["DONE"]


@pytest.mark.parametrize(("kind", "on_the_way"), [(SegmentKind.LEVEL_SWEEP, 3.0), (SegmentKind.RAMP, 0.5)])
def test_neither_a_sweep_of_the_level_nor_a_ramp_down_waits_for_the_phase(kind, on_the_way):
    walk = Walk(_held(1.0, 1.0), Segment(kind, 0, on_the_way, 10.0, amplitude_law=AmplitudeLaw.RESPONSE))
    walk.lock["slowing"] = 1
    assert walk.go(11.1).codes() == ["DONE", "DONE"]


def test_a_ramp_that_waits_in_vain_has_lost_the_lock():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0, point=0, on_lost_lock=OnFailure.SKIP), *_point(1, 4.0)).go(6)
    walk.lock["slowing"] = 1
    assert walk.go(999.0).codes()[1] == "RUNNING"
    assert walk.go(2.0).codes()[1] == "LOST_LOCK"


def test_a_ramp_up_whose_lock_is_lost_on_the_way_ends_at_once_and_one_down_goes_on():
    walk = Walk(_held(1.0, 1.0), _ramp(3.0, 10.0, point=0, on_lost_lock=OnFailure.SKIP), _ramp(0.5, 10.0, point=1)).go(
        6
    )
    walk.lock["state"] = LockState.LOST
    assert walk.go(0.1).codes()[1:] == ["LOST_LOCK", "RUNNING"]
    walk.lock["state"] = LockState.LOST
    assert walk.go(31.0).codes()[2] == "DONE"


def test_after_a_lost_lock_higher_levels_are_left_out_and_the_next_ramp_begins_where_a_lock_was_held():
    skipped = Walk(
        _held(1.0, 5.0),
        _ramp(2.0, 10.0, point=0, on_lost_lock=OnFailure.SKIP),
        _held(2.0, 50.0),
        *(_ramp(3.0, 10.0, point=1), _held(3.0, 10.0)),
        _ramp(0.5, 10.0, point=2),
    )
    skipped.table["kind"][2], skipped.table["point"][2] = SegmentKind.SETTLE, 0
    skipped.table["on_lost_lock"][2] = OnFailure.SKIP
    skipped.go(14)
    skipped.lock["state"] = LockState.ACQUIRING
    skipped.go(3)
    skipped.lock["state"] = LockState.LOST
    before = len(skipped.levels)
    skipped.go(20.2)
    fall = skipped.levels[before:]
    assert max(fall) == 2.0
    assert fall[-1] == pytest.approx(1.0, abs=0.01)
    skipped.go(10)
    assert skipped.levels[-1] == pytest.approx(0.5, abs=0.01)
    assert skipped.codes() == ["DONE", "DONE", "LOST_LOCK", "SKIPPED", "SKIPPED", "DONE"]


def test_a_ramp_down_from_a_level_that_was_not_reached_does_not_wait():
    walk = Walk(_held(3.0, 1.0), _ramp(1.0, 10.0), _held(1.0, 5.0)).go(1).go(11, unreached=True)
    assert walk.codes() == ["DONE", "DONE", "RUNNING"]
    assert walk.levels[-1] == 1.0


def test_a_frequency_that_stands_at_its_window_for_twenty_periods_fails_the_point():
    walk = Walk(*_point(0, 1.0), *_point(1, 2.0)).go(12)
    walk.settling["clamped_periods"] = 19
    walk.go(1)
    assert walk.codes()[1] == "RUNNING"
    walk.settling["clamped_periods"] = 20
    walk.go(1)
    assert walk.codes()[:3] == ["DONE", "OUTSIDE_WINDOW", "SKIPPED"]


def test_a_plan_that_settles_is_recorded_and_ends_the_run():
    walk = Walk(*_point(0, 1.0))
    walk.go(12)
    walk.settling["good_periods"] = RULE.settled_periods
    walk.go(25)
    assert walk.codes() == ["DONE"] * 3
    assert EndReason(int(walk.guard["reason"][0])) is EndReason.COMPLETED
    assert walk.outcomes["periods"][2] == pytest.approx(20.0, abs=0.05)


@pytest.mark.parametrize("kind", [SegmentKind.START, SegmentKind.HOLD])
def test_a_start_and_a_hold_go_on_until_the_harmonics_are_controlled_but_not_forever(kind):
    walk = Walk(Segment(kind, -1, 1.0, 10.0), *_point(0, 2.0))
    walk.settling["good_periods"], walk.settling["distortion"] = 99, math.inf
    assert walk.go(200).codes()[0] == "RUNNING"
    walk.settling["distortion"] = 0.5
    assert walk.go(0.1).codes()[0] == "DONE"
    walk = Walk(Segment(kind, -1, 1.0, 10.0), *_point(0, 2.0))
    walk.settling["good_periods"], walk.settling["distortion"] = 99, math.inf
    assert walk.go(309).codes()[0] == "RUNNING"
    assert walk.go(2).codes()[0] == "DONE"


def test_a_start_that_is_judged_lasts_until_it_is_released_and_no_shorter():
    walk = Walk(Segment(SegmentKind.START, -1, 1.0, 10.0), *_point(0, 2.0))
    walk.progress["held_back"] = 1
    assert walk.go(500).codes()[0] == "RUNNING"
    assert max(walk.levels) == 1.0
    walk.progress["held_back"] = 0
    assert walk.go(0.1).codes()[0] == "DONE"
    early = Walk(Segment(SegmentKind.START, -1, 1.0, 10.0), *_point(0, 2.0)).go(9)
    assert early.codes()[0] == "RUNNING"


def test_the_outcome_of_a_segment_tells_the_error_of_the_harmonics_and_those_left_alone():
    walk = Walk(Segment(SegmentKind.HOLD, -1, 1.0, 10.0), *_point(0, 2.0))
    walk.settling["distortion"], walk.settling["left_alone"] = 0.25, 1 << 5
    walk.go(11)
    assert (walk.outcomes["distortion"][0], walk.outcomes["left_alone"][0]) == (0.25, 1 << 5)


def test_a_point_that_does_not_settle_is_skipped_and_the_next_is_tried():
    walk = Walk(*_point(0, 1.0), *_point(1, 2.0)).go(42)
    assert walk.codes()[:3] == ["DONE", "NOT_SETTLED", "SKIPPED"]
    assert walk.codes()[3] == "RUNNING"


def test_a_point_that_does_not_settle_stops_a_plan_that_says_so():
    walk = Walk(*_point(0, 1.0, OnFailure.STOP), *_point(1, 2.0)).go(60)
    assert walk.codes() == ["DONE", "NOT_SETTLED", "PENDING", "PENDING", "PENDING", "PENDING"]
    assert EndReason(int(walk.guard["reason"][0])) is EndReason.PLAN_STOPPED


def test_a_lost_lock_fails_the_point_and_is_sought_again_where_the_plan_says_so():
    skip = OnFailure.SKIP
    walk = Walk(*_point(0, 1.0, on_lost_lock=skip), *_point(1, 2.0)).go(12)
    walk.lock["state"] = LockState.LOST
    walk.go(1)
    assert walk.codes()[:3] == ["DONE", "LOST_LOCK", "SKIPPED"]
    assert LockState(int(walk.lock["state"][0])) is LockState.ACQUIRING


def test_a_lost_lock_trips_unless_the_plan_says_otherwise():
    walk = Walk(*_point(0, 1.0), *_point(1, 2.0)).go(12)
    walk.lock["state"] = LockState.LOST
    walk.go(1)
    assert EndReason(int(walk.guard["reason"][0])) is EndReason.LOST_LOCK


def test_a_disturbed_record_spoils_the_point():
    walk = Walk(*_point(0, 1.0)).go(12)
    walk.settling["good_periods"] = RULE.settled_periods
    walk.go(1)
    walk.settling["bad_periods"] = RULE.average_periods
    walk.go(1)
    assert walk.codes() == ["DONE", "DONE", "DISTURBED"]


def test_a_stop_interrupts_the_segment_under_way():
    walk = Walk(*_point(0, 1.0)).go(12)
    walk.guard["stop_requested"] = 1
    walk.go(1)
    assert walk.codes() == ["DONE", "INTERRUPTED", "PENDING"]
    assert GuardMode(int(walk.guard["mode"][0])) is GuardMode.RAMPING


def _recording(retries, *segments):
    """A walk that is recording its first point, with so many repetitions left."""
    walk = Walk(*segments)
    walk.progress["retries"], walk.progress["point"] = retries, -1
    walk.go(12)
    walk.settling["good_periods"] = RULE.settled_periods
    return walk.go(1)


def _refused(walk):
    count = int(walk.progress["n_refused"][0])
    return [Outcome(int(entry["outcome"])).name for entry in walk.progress["refused"][0][:count]]


def test_a_disturbed_record_goes_back_to_settling_at_its_level_as_often_as_it_may():
    walk = _recording(2, *_point(0, 1.0), *_point(1, 2.0))
    for tried in (1, 2):
        walk.settling["bad_periods"] = RULE.average_periods
        walk.go(1)
        assert walk.codes()[:3] == ["DONE", "RUNNING", "PENDING"]
        assert _refused(walk) == ["DISTURBED"] * tried
        assert walk.levels[-1] == 1.0
        walk.settling["good_periods"] = RULE.settled_periods
        walk.go(1)
    walk.settling["bad_periods"] = RULE.average_periods
    walk.go(1)
    assert walk.codes()[:4] == ["DONE", "DONE", "DISTURBED", "RUNNING"]
    assert len(_refused(walk)) == 2


def test_the_next_point_may_be_repeated_as_often_again():
    walk = _recording(1, *_point(0, 1.0), *_point(1, 2.0))
    for _ in range(2):
        walk.settling["bad_periods"] = RULE.average_periods
        walk.go(1)
        walk.settling["good_periods"] = RULE.settled_periods
        walk.go(1)
    walk.settling["bad_periods"] = 0
    walk.go(10)
    walk.settling["good_periods"] = RULE.settled_periods
    walk.go(1)
    walk.settling["bad_periods"] = RULE.average_periods
    walk.go(1)
    assert _refused(walk) == ["DISTURBED", "DISTURBED"]
    assert walk.codes() == ["DONE", "DONE", "DISTURBED", "DONE", "RUNNING", "PENDING"]


def test_a_held_output_ends_a_record_once_the_device_follows_again():
    walk = _recording(1, *_point(0, 1.0))
    walk.progress["held"], walk.progress["disturbed"] = 3, 1
    walk.go(1)
    assert walk.codes()[2] == "RUNNING"
    walk.progress["disturbed"] = 0
    walk.go(1)
    assert walk.codes()[1:] == ["RUNNING", "PENDING"]
    entry = walk.progress["refused"][0][0]
    assert _refused(walk) == ["OUTPUT_HELD"]
    assert entry["held"] == 3
    assert (
        entry["end_sample"] - entry["first_sample"] == 99
    )  # begun one sample after the settling, ended at a period's first
    assert entry["periods"] == pytest.approx(99 / 50)


@pytest.mark.parametrize(("lost", "again"), [(50, False), (52, True)])
def test_a_record_is_repeated_at_its_end_if_more_than_a_twentieth_was_lost(lost, again):
    walk = _recording(1, *_point(0, 1.0))
    walk.go(18)
    walk.progress["lost"] = lost  # of 20 periods of 50 samples
    walk.go(2)
    assert _refused(walk) == ["SAMPLES_LOST"] * again
    assert walk.codes()[2] == ("PENDING" if again else "DONE")


def test_a_record_is_given_up_as_soon_as_too_many_of_its_samples_are_certain():
    """A record has 20 periods of 50 samples: 250 may be continued, 50 lost, and 50 held."""
    for name, allowed, outcome in (
        ("continued", 250, "OUTPUT_CONTINUED"),
        ("lost", 50, "SAMPLES_LOST"),
        ("held", 50, "OUTPUT_HELD"),
    ):
        walk = _recording(0, *_point(0, 1.0), *_point(1, 2.0)).go(2)
        walk.progress[name] = allowed
        walk.progress["disturbed"] = 1
        walk.go(1)
        assert walk.codes()[2] == "RUNNING"
        walk.progress[name] = allowed + 3
        walk.go(1)
        assert walk.codes()[2:4] == [outcome, "RUNNING"]  # the next point begins
        assert _refused(walk) == []


def test_a_record_is_tried_beyond_its_retries_while_fewer_samples_are_faulty_up_to_six_times():
    def attempts(*faulty):
        walk = _recording(2, *_point(0, 1.0), *_point(1, 2.0))
        for lost in faulty:
            walk.go(2)
            walk.progress["lost"] = lost
            walk.go(1)
            walk.settling["good_periods"] = RULE.settled_periods
            walk.go(1)
        return len(_refused(walk)) + 1, walk.codes()[2]

    assert attempts(99, 99, 99) == (3, "SAMPLES_LOST")
    assert attempts(99, 120, 98, 97, 97) == (5, "SAMPLES_LOST")
    assert attempts(99, 98, 97, 96, 95, 94) == (6, "SAMPLES_LOST")
    assert attempts(99, 98, 97, 96, 95, 10)[0] == 6


def test_a_plan_without_retries_tries_nothing_again_however_much_better_it_became():
    walk = _recording(0, *_point(0, 1.0), *_point(1, 2.0)).go(2)
    walk.progress["lost"] = 60
    walk.go(1)
    assert _refused(walk) == []


@pytest.mark.parametrize(
    "outcome", ["NOT_SETTLED", "LOST_LOCK", "TOO_STEEP", "NEAR_LIMIT", "UNREACHABLE", "OUTSIDE_WINDOW"]
)
def test_what_does_not_pass_is_not_repeated(outcome):
    skips = OnFailure.SKIP, OnFailure.SKIP
    walk = _recording(3, *_point(0, 1.0, *skips), *_point(1, 2.0))
    walk.progress["held"] = 3
    walk.progress["disturbed"] = 1
    if outcome == "NOT_SETTLED":
        walk = Walk(*_point(0, 1.0), *_point(1, 2.0))
        walk.progress["retries"] = 3
        walk.go(42)
    elif outcome == "LOST_LOCK":
        walk.lock["state"] = LockState.LOST
    elif outcome == "TOO_STEEP":
        walk = Walk(*_point(0, 1.0, *skips), *_point(1, 2.0))
        walk.lock["steep_periods"] = STEEP_PERIODS
    elif outcome == "NEAR_LIMIT":
        walk = Walk(*_point(0, 1.0, *skips), *_point(1, 2.0))
        walk.progress["kept_level"], walk.guard["near_periods"] = 0.5, NEAR_PERIODS
    elif outcome == "UNREACHABLE":
        walk.settling["saturated_periods"] = 20
    else:
        walk.settling["clamped_periods"] = 20
    walk.go(1)
    assert outcome in walk.codes()
    assert _refused(walk) == []


@pytest.mark.parametrize("outcome", ["TOO_STEEP", "NEAR_LIMIT"])
@pytest.mark.parametrize("rule", [OnFailure.SKIP, OnFailure.STOP])
def test_a_ramp_that_is_given_up_leaves_out_the_level_and_what_is_above(rule, outcome):
    ramps = [
        Segment(kind, number, level, 10.0, on_lost_lock=rule)
        for number, level in ((0, 1.0), (1, 2.0), (2, 3.0), (3, 0.5))
        for kind in (SegmentKind.RAMP, SegmentKind.HOLD)
    ]
    walk = Walk(*ramps).go(25)
    if outcome == "TOO_STEEP":
        walk.lock["steep_periods"] = STEEP_PERIODS
    else:
        walk.guard["near_periods"] = NEAR_PERIODS
    walk.go(1)
    walk.guard["near_periods"] = 0  # the level falls
    assert walk.codes()[:3] == ["DONE", "DONE", outcome]
    if rule is OnFailure.STOP:
        assert EndReason(int(walk.guard["reason"][0])) is EndReason.PLAN_STOPPED
        return
    assert walk.codes()[3:7] == ["SKIPPED", "SKIPPED", "SKIPPED", "RUNNING"]
    assert walk.lock["steep_periods"][0] == 0
    before = walk.progress["level"][0]
    assert before > 1.0
    walk.go(35)
    assert max(walk.levels[-1700:]) <= before  # back to the last level that was held, and down from there
    assert walk.levels[-1] == 0.5


@pytest.mark.parametrize(
    ("after", "kept", "then", "outcomes"),
    [
        (5, 0.5, SegmentKind.SETTLE, ["NEAR_LIMIT", "SKIPPED"]),
        (5, 0.0, SegmentKind.SETTLE, ["NEAR_LIMIT", "PENDING"]),  # nothing was held below: the run ends
        (12, 0.0, SegmentKind.START, ["DONE", "NEAR_LIMIT"]),
        (5, 1.0, SegmentKind.SETTLE, ["RUNNING", "PENDING"]),  # a level that was held once
        (12, 0.5, SegmentKind.SETTLE, ["DONE", "NEAR_LIMIT"]),
        (12, 0.5, SegmentKind.RECORD, ["DONE", "RUNNING"]),  # what is measured is finished
    ],
)
def test_a_level_near_a_limit_is_given_up_in_its_ramp_and_until_it_settles(after, kept, then, outcomes):
    kinds = (SegmentKind.RAMP, then)
    walk = Walk(*(Segment(kind, 0, 1.0, 10.0, on_lost_lock=OnFailure.SKIP) for kind in kinds))
    walk.progress["kept_level"] = kept
    walk.go(after)
    walk.guard["near_periods"] = NEAR_PERIODS
    assert walk.go(1).codes() == outcomes
    stopped = walk.guard["reason"][0] == EndReason.PLAN_STOPPED
    assert stopped == ("NEAR_LIMIT" in outcomes and kept == 0.0)


def test_a_steep_backbone_makes_a_ramp_longer_and_no_lost_lock_of_it():
    walk = Walk(Segment(SegmentKind.HOLD, -1, 1.0, 1.0), Segment(SegmentKind.RAMP, 0, 3.0, 300.0))
    walk.lock["steep_slowing"] = 0.8
    walk.go(1490)
    assert walk.codes() == ["DONE", "RUNNING"]
    assert walk.go(20).codes() == ["DONE", "DONE"]
    assert walk.progress["waited_cycles"][0] == 0.0
    assert walk.progress["slowed_cycles"][0] == pytest.approx(1200.0, abs=1.0)


def test_a_waveform_is_played_again_from_its_transient_on():
    played = Excitation(1.0, waveform=0)
    segments = [
        Segment(SegmentKind.RAMP, 0, 1.0, 10.0, excitation=played),
        Segment(SegmentKind.HOLD, 0, 1.0, 3.0, excitation=played),
        Segment(SegmentKind.RECORD, 0, 1.0, 5.0, excitation=played),
        Segment(SegmentKind.RAMP, 1, 2.0, 10.0, excitation=played),
        Segment(SegmentKind.RECORD, 1, 2.0, 5.0, excitation=played),
    ]
    table, _ = segment_table(segments, 5000.0)
    assert table["again"].tolist() == [-1, -1, 1, -1, 4]
