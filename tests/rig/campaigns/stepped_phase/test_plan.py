"""A stepped-phase plan as data: its lags, its segments, the way to what is left of them, and what it refuses."""

import pytest

from controller import AmplitudeLaw, preset
from rig.bench import load_bench
from rig.bench.configuration import validated
from rig.campaigns.plans import load_plan, shipped_plans
from rig.campaigns.stepped_phase.plan import SteppedPhasePlan
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.tick import Tick, TickSettings
from tests.refused import refused

TABLE = {
    "kind": "stepped-phase",
    "bench": "magnet-beam",
    "levels_n": [0.2, 0.4],
    "start_v": 0.3,
    "start_deg": -120.0,
    "stop_deg": -60.0,
    "step_deg": 30.0,
    "controller": preset("magnet-beam", "stepped-phase").model_dump(mode="json"),
}


def plan(without=(), **changes):
    table = {key: value for key, value in (TABLE | changes).items() if key not in without}
    return validated(SteppedPhasePlan, table, "plan")


def ramps(segments):
    """Point, what the level is, level and lag of every ramp."""
    return [
        (s.point, "v" if s.amplitude_law is AmplitudeLaw.VOLTAGE else "n", s.level, s.lag_deg)
        for s in segments
        if s.kind is SegmentKind.RAMP
    ]


@pytest.mark.parametrize(
    ("direction", "lags"),
    [("up", [-120, -90, -60]), ("down", [-60, -90, -120]), ("up-down", [-120, -90, -60, -90, -120])],
)
def test_every_lag_is_measured_at_one_level_after_the_other(direction, lags):
    targets = plan(direction=direction).targets()
    assert [(t.level, t.phase_lag_deg) for t in targets] == [(level, lag) for level in (0.2, 0.4) for lag in lags]
    assert [t.direction for t in targets[:2]] == ["down" if direction == "down" else "up"] * 2


def test_the_last_step_may_be_shorter_and_no_lag_is_stepped_over():
    assert plan(step_deg=25.0).lags == (-120.0, -95.0, -70.0, -60.0)
    assert plan(start_deg=-150.0, stop_deg=-30.0, step_deg=0.1).lags[-2:] == (pytest.approx(-30.1), -30.0)
    given = plan(without=("start_deg", "stop_deg"), phase_lags_deg=[-90.0, -100.0])
    assert given.lags == (-100.0, -90.0)


def test_each_level_is_approached_from_the_starting_voltage_at_the_first_lag():
    way = ramps(plan().segments(5000.0))
    level = [(-1, "v", 0.3, -120.0), (-1, "n", 0.2, -120.0), (0, "n", 0.2, -120.0), (1, "n", 0.2, -90.0)]
    assert way[:4] == level
    assert way[5:8] == [(-1, "v", 0.3, -120.0), (-1, "n", 0.4, -120.0), (3, "n", 0.4, -120.0)]


def test_a_level_may_be_approached_at_another_lag():
    way = ramps(plan(approach_deg=-90.0).segments(5000.0))
    assert way[:3] == [(-1, "v", 0.3, -90.0), (-1, "n", 0.2, -90.0), (0, "n", 0.2, -120.0)]


def test_a_resumed_point_is_stepped_to_from_the_lag_before():
    way = ramps(plan().segments(5000.0, frozenset({0, 1, 3, 4, 5})))
    assert way == [(-1, "v", 0.3, -90.0), (-1, "n", 0.2, -90.0), (2, "n", 0.2, -60.0)]
    falling = plan(direction="up-down", approach_deg=-90.0).segments(5000.0, frozenset({*range(3), *range(5, 10)}))
    assert ramps(falling)[1:] == [
        (-1, "n", 0.2, -90.0),
        (-1, "n", 0.2, -60.0),
        (3, "n", 0.2, -90.0),
        (4, "n", 0.2, -120.0),
    ]


def test_a_finished_plan_has_no_segments_left():
    assert plan().segments(5000.0, frozenset(range(6))) == ()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start_deg": -190.0}, {"field": "start_deg", "value": -190.0, "allowed": "-175 to -5"}),
        ({"approach_deg": 10.0}, {"field": "approach_deg", "value": 10.0, "allowed": "-175 to -5"}),
        ({"stop_deg": -130.0}, {"field": "stop_deg", "value": -130.0, "allowed": "above `start_deg`"}),
        ({"phase_lags_deg": [-90.0]}, {"says": "exactly-one-of-the-two"}),
        ({"stop_deg": None}, {"says": "exactly-one-of-the-two"}),
        ({"step_deg": 0.001}, {"says": "step-deg-are-points", "field": "step_deg", "allowed": "up to 10000"}),
        (
            {"controller": TABLE["controller"] | {"phase_lag_deg": -80.0}},
            {"field": "controller.phase_lag_deg", "value": -80.0},
        ),
        (
            {"controller": TABLE["controller"] | {"detector": "sign"}},
            {"says": "knows-phase-resonance-only", "field": "controller.detector", "value": "sign"},
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(changes, words):
    with refused(ConfigurationError, **words) as caught:
        plan(**changes)
    assert "\n" not in str(caught.value)


def test_levels_beyond_the_bench_are_refused():
    bench = load_bench("magnet-beam")
    with refused(ConfigurationError, "the-bench-magnet-beam-allows-up-4", field="levels_n[1]", value=41.0):
        plan(levels_n=[0.2, 41.0]).check(bench)
    window = TABLE["controller"] | {"frequency_window_hz": [20.0, 24.1]}
    with refused(
        ConfigurationError, "specimen-linear-frequency-hz", field="controller.frequency_window_hz", value=[20.0, 24.1]
    ):
        plan(controller=window).check(bench)


@pytest.mark.parametrize("name", [name for name in shipped_plans() if name.endswith("/stepped-phase-paper")])
def test_the_plan_of_the_paper_holds_its_gains_and_levels(name):
    shipped = load_plan(name)
    specimen = name.split("/")[0]
    paper = preset(specimen, "stepped-phase")
    for gain in ("detector", "low_pass_rad_s", "k1", "k2", "k3", "k4", "centre_frequency_hz"):
        assert getattr(shipped.controller, gain) == pytest.approx(getattr(paper, gain))
    levels = {"magnet-beam": [0.25, 0.55], "friction-beam": [2.0, 5.0, 15.0]}[specimen]
    assert [2.0**0.5 * level for level in shipped.levels] == pytest.approx(levels, rel=1e-5)
    assert shipped.lags == pytest.approx([*range(-150, -29, 10)])


@pytest.mark.parametrize("name", [name for name in shipped_plans() if "/stepped-phase" in name])
def test_a_tick_can_be_built_of_every_shipped_plan(name):
    shipped = load_plan(name)
    bench = load_bench(shipped.bench)
    shipped.check(bench)
    Tick(TickSettings(bench, shipped.law, shipped.amplitude_law, shipped.settle_rule, shipped.segments(5000.0)), 2.0)
