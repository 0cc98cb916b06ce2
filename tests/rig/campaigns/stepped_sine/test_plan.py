"""A stepped-sine plan as data: its points, its segments, and the way to what is left of them after an interruption."""

from controller import AmplitudeLaw
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.campaigns.sweep.plan import SweepPlan
from rig.tick.sequencer.layout import SegmentKind

PLAN = SteppedSinePlan(bench="magnet-beam", levels_v=(1.0, 2.0), frequencies_hz=(22.0, 23.0, 24.0))


def _ways(done):
    segments = PLAN.segments(5000.0, frozenset(done))
    return [(s.point, s.level, s.excitation.frequency_hz) for s in segments if s.kind is SegmentKind.RAMP], segments


def test_every_frequency_is_measured_at_one_level_after_the_other():
    points = [(target.level, target.frequency_hz) for target in PLAN.targets()]
    assert points == [(v, f) for v in (1.0, 2.0) for f in (22.0, 23.0, 24.0)]


def test_a_new_level_begins_from_rest_at_its_first_frequency():
    ways, _ = _ways(())
    assert ways[3:6] == [(-1, 0.0, 24.0), (3, 0.0, 22.0), (3, 2.0, 22.0)]


def test_a_resumed_test_passes_through_what_is_done_of_a_level():
    ways, segments = _ways({0, 1, 3})
    assert ways[:3] == [(-1, 1.0, 22.0), (-1, 1.0, 23.0), (2, 1.0, 24.0)]
    assert ways[3:] == [(-1, 0.0, 24.0), (-1, 0.0, 22.0), (-1, 2.0, 22.0), (4, 2.0, 23.0), (5, 2.0, 24.0)]
    assert [s.point for s in segments if s.kind is SegmentKind.RECORD] == [2, 4, 5]


def test_what_is_done_at_the_end_of_a_level_is_left_alone():
    ways, _ = _ways({1, 2, 3, 4, 5})
    assert ways == [(0, 1.0, 22.0)]
    assert _ways(range(6))[1] == ()


def test_a_held_force_is_approached_by_a_voltage_and_left_by_one_at_every_level():
    plan = SteppedSinePlan(bench="magnet-beam", levels_n=(1.0, 2.0), frequencies_hz=(22.0, 23.0), start_v=0.3)
    ways = [(s.kind, s.level, s.excitation.frequency_hz) for s in plan.segments(5000.0)]
    by_voltage = [s.amplitude_law is AmplitudeLaw.VOLTAGE for s in plan.segments(5000.0)]
    ramp, hold = SegmentKind.RAMP, SegmentKind.HOLD
    assert ways[:3] == [(ramp, 0.3, 22.0), (hold, 0.3, 22.0), (ramp, 1.0, 22.0)]
    assert ways[8:13] == [(ramp, 0.0, 23.0), (ramp, 0.0, 22.0), (ramp, 0.3, 22.0), (hold, 0.3, 22.0), (ramp, 2.0, 22.0)]
    assert [n for n, volts in enumerate(by_voltage) if volts] == [0, 1, 8, 9, 10, 11]


def test_a_controlled_sweep_begins_and_ends_with_a_voltage():
    plan = SweepPlan(bench="magnet-beam", levels_n=(1.0,), start_hz=22.0, stop_hz=25.0, rate_hz_per_s=1.0, start_v=0.3)
    laws = [s.amplitude_law for s in plan.segments(5000.0)]
    assert laws == [AmplitudeLaw.VOLTAGE] * 3 + [None] * 3 + [AmplitudeLaw.VOLTAGE]
    assert [s.level for s in plan.segments(5000.0)] == [0.0, 0.3, 0.3, 1.0, 1.0, 1.0, 0.0]
