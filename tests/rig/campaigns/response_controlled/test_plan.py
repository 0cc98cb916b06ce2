"""A response-controlled plan as data: its points, its segments, what is left of it, and what it refuses."""

import pytest

from controller import AmplitudeLaw
from rig.bench import load_bench
from rig.campaigns.plans import load_plan, plan_from
from rig.campaigns.response_controlled.plan import ResponseControlledPlan
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import SegmentKind
from tests.refused import refused
from tests.rig.campaigns.running.test_continuation import recording

LAW = {
    "frequency_law": "frequency-error",
    "frequency_integral_per_s": 4.0,
    "centre_frequency_hz": 24.0,
    "frequency_window_hz": (22.0, 27.0),
    "response_integral_per_s": 8.0,
}
FRICTION = LAW | {"centre_frequency_hz": 149.0, "frequency_window_hz": (134.0, 164.0)}
TABLE = {
    "kind": "response-controlled",
    "bench": "magnet-beam",
    "controller": LAW,
    "levels_m": (2e-3, 1e-3),
    "phase_lags_deg": (-60.0, -120.0, -90.0),
    "start_v": 0.2,
}


def plan(**changes: object) -> ResponseControlledPlan:
    made = plan_from(TABLE | changes, "plan")
    assert isinstance(made, ResponseControlledPlan)
    return made


def ramps(done=(), **changes):
    segments = plan(**changes).segments(5000.0, frozenset(done))
    return [(s.point, s.level, s.lag_deg, s.periods) for s in segments if s.kind is SegmentKind.RAMP]


def test_every_lag_is_measured_at_the_lowest_level_first_from_below_resonance():
    points = [(target.level, target.phase_lag_deg, target.direction) for target in plan().targets()]
    assert points == [(x, lag, "up") for x in (1e-3, 2e-3) for lag in (-120.0, -90.0, -60.0)]


def test_both_directions_turn_round_at_the_last_lag_without_measuring_it_twice():
    points = [(t.phase_lag_deg, t.direction) for t in plan(direction="up-down").targets()][:5]
    assert points == [(-120.0, "up"), (-90.0, "up"), (-60.0, "up"), (-90.0, "down"), (-120.0, "down")]


def test_the_loop_takes_over_from_the_start_voltage_and_every_other_segment_holds_the_displacement():
    first, hold, *rest = plan().segments(5000.0)
    assert [(s.kind, s.level, s.amplitude_law) for s in (first, hold)] == [
        (SegmentKind.RAMP, 0.2, AmplitudeLaw.VOLTAGE),
        (SegmentKind.START, 0.2, AmplitudeLaw.VOLTAGE),
    ]
    assert {s.amplitude_law for s in rest} == {AmplitudeLaw.RESPONSE}
    assert [s.kind for s in rest[:3]] == [SegmentKind.RAMP, SegmentKind.SETTLE, SegmentKind.RECORD]


def test_ramps_go_slowly_to_another_level_and_quickly_along_the_lags():
    assert [one[3] for one in ramps()] == [10.0, 40.0, 10.0, 10.0, 40.0, 10.0, 10.0]


def test_what_is_left_of_a_level_is_approached_from_the_lag_before():
    assert ramps({0, 1, 3})[1:] == [
        (-1, 1e-3, -90.0, 40.0),
        (2, 1e-3, -60.0, 10.0),
        (-1, 2e-3, -120.0, 40.0),
        (4, 2e-3, -90.0, 10.0),
        (5, 2e-3, -60.0, 10.0),
    ]
    assert plan().segments(5000.0, frozenset(range(6))) == ()


def test_a_level_that_is_added_leaves_the_points_of_the_others_their_numbers(tmp_path):
    from rig.campaigns.running.continuation import remaining

    held = recording(tmp_path, (plan(), None))
    left = remaining(held, plan(levels_m=(1e-3, 1.5e-3, 2e-3)), "more.toml")
    assert left.numbers == (0, 1, 2, 6, 7, 8, 3, 4, 5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"levels_m": None, "levels_n": (1.0,)},
            {"field": "levels_n", "allowed": "levels_m, for the displacement is held"},
        ),
        ({"phase_lags_deg": ()}, {"says": "at-least-one-lag-is-needed", "field": "phase_lags_deg", "value": []}),
        ({"phase_lags_deg": (-90.0, -178.0)}, {"field": "phase_lags_deg[1]", "value": -178.0, "allowed": "-175 to -5"}),
        ({"phase_lags_deg": (-90.0, -90.0)}, {"says": "lag-is-given-twice", "field": "phase_lags_deg"}),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_name(changes, said):
    with refused(ConfigurationError, **said):
        plan(**changes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"start_v": None}, {"says": "levels-by-levels-of-this-loop", "field": "start_v"}),
        ({"levels_m": (0.1,)}, {"says": "the-bench-magnet-beam-allows-up", "field": "levels_m[0]", "value": 0.1}),
        (
            {"harmonics": 50, "bench": "friction-beam", "controller": FRICTION, "levels_m": (1e-4,)},
            {"field": "harmonics", "value": 50},
        ),
        (
            {"controller": LAW | {"frequency_window_hz": (22.0, 24.2)}},
            {"field": "controller.frequency_window_hz", "value": [22.0, 24.2]},
        ),
    ],
)
def test_what_the_bench_cannot_do_is_refused_before_anything_moves(changes, said):
    made = plan(**changes)
    with refused(ConfigurationError, **said):
        made.check(load_bench(made.bench))


@pytest.mark.parametrize("bench", ["magnet-beam", "friction-beam"])
@pytest.mark.parametrize(
    "name",
    [
        "response-controlled",
        *(f"{kind}-{way}" for kind in ("stepped-sine", "controlled-sweep") for way in ("up", "down")),
    ],
)
def test_shipped_plans_fit_their_benches(bench, name):
    made = load_plan(f"{bench}/{name}")
    made.check(load_bench(bench))
    assert made.targets()
