"""Every rule by which a run notices that it does not measure what it should: provoked, caught, told, and gone on from."""

import numpy as np
import pytest

import rig
from controller import AmplitudeLaw, preset
from rig.campaigns.backbone.plan import BackbonePlan
from rig.tick.layout import FREQUENCY_CLAMPED, SATURATED
from rig.tick.sequencer.layout import Outcome, SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from tests.closed_loop.laws import carried_out, knock, law_of, plan_of
from tests.rig.rigs import bench_with

SHORT = SettleRule(longest_periods=200).model_dump()


def points_and_end(plan, bench, seed=0):
    with rig.run(plan, bench=bench, seed=seed) as run:
        return run.recording.points, run.recording.parts[0].end


def test_another_mode_locks_perfectly_so_that_only_its_frequency_tells():
    """In a window that reaches from the first mode to the second, the loop finds the second at 90 degrees."""
    wide = preset("magnet-beam").model_dump() | {"centre_frequency_hz": 131.0, "frequency_window_hz": (20.0, 200.0)}
    plan = BackbonePlan.model_validate({"bench": "magnet-beam", "controller": wide, "levels_v": (0.4,)})
    points, _ = points_and_end(plan, bench_with())
    assert points[0]["accepted"]
    assert points[0]["frequency_hz"] == pytest.approx(134.06, abs=0.1)  # the rig's second mode
    assert abs(points[0]["phase_error_deg"]) < 1.0
    assert any("another mode" in warning for warning in points[0]["warnings"])
    assert points[0]["quality"] == "warned"


def test_the_frequency_window_keeps_another_mode_out_and_says_so():
    mistaken = bench_with({"specimen": {"linear_frequency_hz": 121.0}})
    window = {
        "centre_frequency_hz": 121.0,
        "frequency_window_hz": (108.9, 133.1),
    }  # 10 % to either side; mode 2 is above
    plan = plan_of("magnet-beam", window, levels_v=(0.2, 0.4))
    with rig.run(plan, bench=mistaken) as run:
        points, end = run.recording.points, run.recording.parts[0].end
        flags = run.recording.parts[0].rows("flags")
        frequency = run.recording.parts[0].rows("frequency_hz")
        highest_v = np.abs(run.recording.parts[0].rows("command_v")).max()
    assert [point["quality"] for point in points] == ["outside-window"] * 2
    assert "another mode" in points[0]["reason"]
    assert frequency.max() <= 133.1 * (1 + 1e-6)
    assert np.count_nonzero(flags & FREQUENCY_CLAMPED) > 500
    assert end["skipped"] == "2 of 2 points skipped: outside-window (0.2 V, 0.4 V)"
    assert end["reason"] == "no_lock_in_window"
    assert highest_v < 0.201  # no level after the first was tried


def test_a_scattering_lag_is_warned_of():
    points, _ = points_and_end(
        plan_of("magnet-beam", levels_v=(0.03,), settle=SettleRule(phase_deg=5, amplitude=0.1).model_dump()),
        bench_with(noise_scale=18.0),
    )
    assert points[0]["phase_scatter_deg"] > 5.0
    assert any(
        "the lag scatters by" in warning and "steps of its converter" in warning for warning in points[0]["warnings"]
    )
    quiet, _ = points_and_end(plan_of("magnet-beam", levels_v=(0.1,)), bench_with())
    assert not any("scatters" in warning for warning in quiet[0]["warnings"])


def test_below_four_tenths_of_a_bit_no_phase_is_read_and_none_is_reported():
    points, end = points_and_end(plan_of("magnet-beam", levels_v=(0.002, 0.1), settle=SHORT), bench_with())
    assert points[0]["quality"] == "not-settled"
    assert "too small" in points[0]["reason"]
    assert points[1]["accepted"]
    assert end["skipped"] == "1 of 2 points skipped: not-settled (0.002 V)"


@pytest.mark.parametrize("levels", [{"levels_m": (5e-5, 2e-4)}, {"levels_n": (2.0, 40.0)}])
def test_a_level_beyond_the_voltage_limit_is_reported_and_the_next_is_measured(levels):
    bench = bench_with({"limits": {"voltage_v": 0.5}}, "friction-beam")
    plan = plan_of("friction-beam", start_v=0.05, direction="up-down", **levels)
    points, end = points_and_end(plan, bench)
    assert [point["quality"] for point in points] == ["good", "unreachable", "good"]
    assert "voltage limit" in points[1]["reason"]
    assert points[1]["settle_periods"] < 60  # twenty periods at the limit are enough
    # nothing had wound up: on the way down the same vibration again, as quickly
    assert points[2]["frequency_hz"] == pytest.approx(points[0]["frequency_hz"], rel=2e-4)
    assert points[2]["amplitude_m"] == pytest.approx(points[0]["amplitude_m"], rel=0.02)
    assert points[2]["settle_periods"] < 1.5 * points[0]["settle_periods"]
    assert end["skipped"].startswith("1 of 3 points skipped: unreachable")


@pytest.mark.parametrize(("law", "level"), [(AmplitudeLaw.RESPONSE, 2e-4), (AmplitudeLaw.FORCE, 40.0)])
def test_at_the_voltage_limit_the_ramp_waits_and_no_integral_grows(law, level):
    bench = bench_with({"limits": {"voltage_v": 0.5}}, "friction-beam")
    segments = [
        Segment(SegmentKind.RAMP, -1, 0.05, 10.0),
        Segment(SegmentKind.HOLD, -1, 0.05, 40.0),
        Segment(SegmentKind.RAMP, 0, level, 60.0, amplitude_law=law),
    ]
    rows, tick = carried_out(bench, law_of("friction-beam"), segments)
    assert Outcome(int(tick.outcomes["outcome"][2])) is Outcome.UNREACHABLE
    assert np.abs(rows["command_v"]).max() <= 0.5 * (1 + 1e-6)
    limited = (rows["flags"] & SATURATED > 0) & (rows["segment"] == 2)
    assert np.count_nonzero(limited) > 20 * 33  # more than twenty periods
    assert tick.arrays.progress["level"][0] < 0.9 * level  # where the ramp was frozen
    assert tick.arrays.progress["frozen_cycles"][0] >= 20.0
    assert tick.arrays.control["amplitude"]["force"]["log_integral"][0].real < np.log(0.5) + 0.7


def test_a_knock_while_recording_spoils_the_point_and_the_next_is_measured(monkeypatch):
    knock(monkeypatch, 2, 2.0, 0.3)
    plan = plan_of("friction-beam", levels_m=(5e-5, 6e-5), start_v=0.05, record_periods=200, retries=0)
    points, end = points_and_end(plan, bench_with({"block": 5}, "friction-beam"))
    assert [point["quality"] for point in points] == ["disturbed", "good"]
    assert end["skipped"] == "1 of 2 points skipped: disturbed (0.05 mm)"


PATIENT = SettleRule(average_periods=20, settled_periods=300, longest_periods=800).model_dump()


@pytest.mark.parametrize(
    ("rule", "reason", "qualities"),
    [("stop", "lost_lock", ["lost-lock"]), ("skip", "completed", ["lost-lock", "good"])],
)
def test_a_lock_that_a_knock_throws_off_is_noticed_within_twenty_periods(monkeypatch, rule, reason, qualities):
    """The paper's slow controller on the friction beam: a free vibration five times the forced one leads it astray."""
    knock(monkeypatch, 2, 2.6, 0.7)
    plan = BackbonePlan.model_validate(
        {
            "bench": "friction-beam",
            "controller": preset("friction-beam").model_dump(),
            "levels_v": (0.05, 0.3),
            "record_periods": 20,
            "settle": PATIENT,
            "on_lost_lock": rule,
        }
    )
    bench = bench_with({"block": 5, "limits": {"displacement_m": 0.003}}, "friction-beam")
    with rig.run(plan, bench=bench) as run:
        points, part = run.recording.points, run.recording.parts[0]
        states = {event["state"]: event["sample"] for event in part.events if event["what"] == "lock"}
        end = part.end
    assert end["reason"] == reason
    assert end["tripped"] is (reason == "lost_lock")
    assert [point["quality"] for point in points] == qualities
    assert 20 <= (states["lost"] / 5000 - 2.6) * 149 < 32  # twenty far periods, and some until it was far
    assert end["skipped"].startswith(f"{3 - len(qualities)} of 2 points skipped: lost-lock (0.05 V)")
