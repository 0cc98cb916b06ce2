"""Points whose controlled harmonics are off what was wanted, by hand and in whole runs."""

import numpy as np
import pytest

import rig
from rig.campaigns.evaluation.force_harmonics import with_force_harmonics
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.planning.plan import Target
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from tests.refused import refused
from tests.rig.campaigns.made_points import made_point, made_vibration
from tests.rig.rigs import bench_with

BENCH = bench_with()
FORCE, DRIVE = BENCH.index_of("force"), BENCH.index_of("drive")
TURN = np.exp(0.8j)


def plan_with(harmonics=None, **changes):
    table = load_plan("magnet-beam/backbone-pure").model_dump() | changes
    table["controller"]["harmonics"] = {} if harmonics is None else harmonics
    return type(load_plan("magnet-beam/backbone-pure")).model_validate(table)


def judged(ratios, *, plan=None, std=0.0, size=1.0, alone=0, target=None, channel=FORCE, orders=16, **fields):
    """A point whose force has harmonics in these ratios to its fundamental, judged."""
    harmonics = np.zeros((len(BENCH.channels), orders), complex)
    harmonics[:, 1] = size * TURN
    for order, ratio in ratios.items():
        harmonics[channel, order] = ratio * size * TURN**order
    vibration = made_vibration(harmonics, std=np.full(harmonics.shape, std))
    point = made_point(vibration=vibration, **fields)
    target = target or Target(number=0, level=1.0)
    return with_force_harmonics(BENCH, plan or plan_with(), target, point, alone)


def test_a_sine_is_left_as_it_is():
    assert judged({}).quality is Quality.GOOD
    assert judged({2: 0.0049, 7: 0.0049}).quality is Quality.GOOD
    assert judged({8: 0.5}).quality is Quality.GOOD  # above the highest that is controlled


def test_an_error_beyond_what_is_accepted_refuses_the_point_and_names_the_worst_harmonic():
    point = judged({2: 0.006, 5: 0.02j, 6: 0.001})
    assert point.quality is Quality.REJECTED
    assert "harmonic 5 of channel force" in point.reason
    assert "accepted up to 0.5 %" in point.reason
    assert judged({2: 0.006}, plan=plan_with({"accepted": 0.01})).quality is Quality.GOOD


def test_without_the_loop_no_harmonic_counts():
    plan = load_plan("magnet-beam/backbone")
    assert plan.law.harmonics is None
    assert judged({2: 1.9}, plan=plan).quality is Quality.GOOD


def test_three_standard_errors_and_a_tenth_of_a_bit_are_allowed():
    assert judged({2: 0.02}, std=0.007).quality is Quality.GOOD
    assert judged({2: 0.02}, std=0.006).quality is Quality.REJECTED
    force = BENCH.channels[FORCE]
    bit_n = force.resolution_v / abs(force.sensitivity_v_per_unit)
    small = 4.0 * bit_n
    assert judged({2: 0.099 * bit_n / small}, size=small).quality is Quality.GOOD
    assert judged({2: 0.101 * bit_n / small}, size=small).quality is Quality.REJECTED


@pytest.mark.parametrize("wanted", [{2: (0.5, 90.0)}, {3: (0.3, -60.0)}])
def test_prescribed_harmonics_are_judged_in_the_fundamentals_phase(wanted):
    ((order, (ratio, phase_deg)),) = wanted.items()
    right = {order: ratio * np.exp(1j * np.radians(phase_deg))}
    plan = plan_with({"wanted": wanted})
    assert judged(right, plan=plan).quality is Quality.GOOD
    assert judged({}, plan=plan).quality is Quality.REJECTED
    assert judged({order: 1.02 * right[order]}, plan=plan).quality is Quality.REJECTED
    of_target = Target(number=0, level=1.0, harmonics=wanted)
    assert judged(right, target=of_target).quality is Quality.GOOD
    assert judged(right, plan=plan, target=Target(number=0, level=1.0, harmonics={})).quality is Quality.REJECTED


def test_harmonics_that_were_left_alone_only_warn():
    point = judged({2: 0.03, 4: 0.05}, alone=(1 << 2) | (1 << 4))
    assert point.quality.accepted
    (warning,) = point.warnings
    assert "harmonics 2, 4" in warning
    assert "up to 5 % of the fundamental" in warning
    mixed = judged({2: 0.03, 3: 0.05}, alone=1 << 2)
    assert mixed.quality is Quality.REJECTED
    assert "harmonic 3" in mixed.reason


def test_what_did_not_settle_or_is_evaluated_on_its_way_only_warns():
    assert judged({2: 0.03}, settled=False).quality.accepted
    point = judged({2: 0.03}, plan=plan_with(evaluation="slow-flow"))
    assert point.quality.accepted
    assert "harmonic 2" in point.warnings[0]


def test_the_drive_point_is_judged_where_it_is_controlled():
    plan = plan_with({"channel": "drive"})
    assert judged({2: 0.03}, plan=plan).quality is Quality.GOOD
    point = judged({2: 0.03}, plan=plan, channel=DRIVE)
    assert "of channel drive" in point.reason


def test_a_point_that_was_refused_before_keeps_its_reason():
    point = judged({2: 0.03}, quality=Quality.REJECTED)
    assert point.reason == "for a test"


# Plans


@pytest.mark.parametrize(
    ("harmonics", "named"),
    [
        ({"wanted": {"8": [0.5, 0.0]}}, {"field": "wanted", "allowed": "2 to 7, the loop's highest"}),
        ({"wanted": {"2": [0.5]}}, {"says": "wanted"}),
        ({"wanted": {"second": [0.5, 0.0]}}, {"says": "wanted"}),
        ({"highest": 13}, {"field": "controller.harmonics.highest", "value": 13}),
        ({"corner": 0.7}, {"field": "controller.harmonics.corner", "value": 0.7}),
        ({"gain": 0.1}, {"field": "controller.harmonics.gain", "value": 0.1}),
    ],
)
def test_a_bad_table_is_refused_by_name(harmonics, named, tmp_path):
    with refused(ValueError, **named):
        plan_with(harmonics)


@pytest.mark.parametrize("name", ["magnet-beam/sweep-1", "magnet-beam/controlled-sweep-up", "magnet-beam/multisine-1"])
def test_sweeps_and_multisines_refuse_the_loop(name):
    plan = load_plan(name)
    table = plan.model_dump()
    table["controller"]["harmonics"] = {}
    with refused(ConfigurationError, "not-allowed-with-kind", field="controller.harmonics"):
        type(plan).model_validate(table).check(BENCH)


def test_prescribed_harmonics_of_points_need_the_loop_and_its_harmonics():
    varied = load_plan("magnet-beam/harmonics-varied")
    table = varied.model_dump()
    with refused(ValueError, field="force_harmonics[1]", allowed="2 to 7, the loop's highest"):
        type(varied).model_validate(table | {"force_harmonics": [{}, {9: (0.5, 0.0)}]})
    table["controller"]["harmonics"] = None
    with refused(ValueError, "need-the-table-controller-harmonics", field="force_harmonics"):
        type(varied).model_validate(table)


def test_a_frequency_that_is_too_high_for_the_loop_is_refused_before_anything_moves():
    plan = plan_with({"highest": 12}, levels_v=(1.0,))
    bench = bench_with(
        {"sample_rate_hz": 500.0, "limits": {"frequency_hz": (8.0, 100.0)}},
        converter={"anti_alias_hz": 0.0, "oversampling": 1, "substeps": 20},
    )
    with refused(ConfigurationError, "allowed-at-hz", field="controller.harmonics.highest", value=12):
        rig.run(plan, bench=bench)


def test_every_set_of_harmonics_is_a_point_of_its_own_at_every_level():
    plan = plan_with(levels_v=(0.5, 1.0), force_harmonics=({}, {2: (0.5, 0.0)}, {3: (0.1, 90.0)}))
    targets = plan.targets()
    assert [target.level for target in targets] == [0.5] * 3 + [1.0] * 3
    assert [target.harmonics for target in targets[:3]] == [{}, {2: (0.5, 0.0)}, {3: (0.1, 90.0)}]
    for segment in plan.segments(5000.0):
        assert segment.harmonics == targets[segment.point].harmonics
    resumed = plan.segments(5000.0, done=frozenset({0, 1}))
    assert {segment.point for segment in resumed} == {-1, 2, 3, 4, 5}


# Runs


VARIED = {
    "levels_v": (0.6, 1.2),
    "force_harmonics": ({}, {2: (0.5, 120.0)}),
    "ramp_periods": 10,
    "record_periods": 10,
}


def recorded_ratio(point, order):
    harmonics = np.array([complex(*pair) for pair in point["harmonics"][FORCE]])
    return harmonics[order] / (abs(harmonics[1]) * (harmonics[1] / abs(harmonics[1])) ** order)


def test_a_resumed_run_makes_the_harmonics_of_the_points_that_are_left(tmp_path):
    file = tmp_path / "varied.h5"
    first = plan_with(**VARIED | {"levels_v": (0.6,)})
    rig.run(first, output=file, seed=1).close()
    with rig.resume(file, plan=plan_with(**VARIED)) as run:
        assert run.complete
        points = list(run.recording.latest.values())
    assert [point["part"] for point in points] == [0, 0, 1, 1]
    for point in points:
        wanted = 0.5 * np.exp(2j * np.pi / 3) if point["number"] % 2 else 0.0
        assert recorded_ratio(point, 2) == pytest.approx(wanted, abs=0.003)
        assert recorded_ratio(point, 3) == pytest.approx(0.0, abs=0.003)


def test_points_of_another_force_are_measured_again_when_the_loop_is_added_or_asked_for_something_else(tmp_path):
    file, levels = tmp_path / "points.h5", {"levels_v": (0.6,), "record_periods": 10}
    table = plan_with(**levels).model_dump()
    table["controller"]["harmonics"] = None
    rig.run(type(plan_with()).model_validate(table), output=file, seed=1).close()
    for part, loop in enumerate(({}, {"wanted": {2: (0.5, 0.0)}}), start=1):
        with rig.resume(file, plan=plan_with(loop, **levels)) as run:
            assert run.complete
            point = list(run.recording.latest.values())[-1]
        assert point["part"] == part
        assert recorded_ratio(point, 2) == pytest.approx(0.5 if part == 2 else 0.0, abs=0.003)
    with rig.resume(file, plan=plan_with({"wanted": {2: (0.5, 0.0)}, "corner": 0.25}, **levels)) as run:
        assert run.complete
        assert len(run.recording.points) == 3  # other gains make no other point


@pytest.mark.parametrize(
    ("limit_v", "loop", "said"),
    [
        (1.2, {}, "the voltage limit left no room"),
        (9.5, {"largest": 0.005}, "times their tolerance off"),
    ],
)
def test_a_point_whose_harmonics_are_out_of_reach_does_not_settle_and_says_why(limit_v, loop, said):
    bench = bench_with({"limits": {"voltage_v": limit_v}})
    table = plan_with(loop, levels_v=(0.6, 1.2), record_periods=10).model_dump()
    table["settle"]["longest_periods"] = 150
    with rig.run(type(plan_with()).model_validate(table), bench=bench, seed=1) as run:
        assert not run.complete
        last = run.recording.points[-1]
    assert last["quality"] == "not-settled"
    assert said in last["reason"]
