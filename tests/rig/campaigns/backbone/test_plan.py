"""A backbone plan as data: its points, its segments, and what is left of them after an interruption."""

import pytest

from controller import preset
from rig.bench import shipped_benches
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.plans import bench_of, load_plan, plan_from, shipped_plans
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import SegmentKind
from tests.refused import refused


def _plan(**changes):
    table = {"bench": "magnet-beam", "controller": preset("magnet-beam").model_dump(), "levels_v": [0.4, 0.2, 0.6]}
    return BackbonePlan.model_validate(table | changes)


@pytest.mark.parametrize(
    ("direction", "levels"),
    [("up", [0.2, 0.4, 0.6]), ("down", [0.6, 0.4, 0.2]), ("up-down", [0.2, 0.4, 0.6, 0.4, 0.2])],
)
def test_the_levels_are_sorted_by_the_direction(direction, levels):
    targets = _plan(direction=direction).targets()
    assert [target.level for target in targets] == levels
    assert [target.number for target in targets] == list(range(len(levels)))


def test_every_point_is_ramped_settled_and_recorded():
    kinds = [segment.kind for segment in _plan().segments(5000.0)]
    assert kinds == [SegmentKind.RAMP, SegmentKind.SETTLE, SegmentKind.RECORD] * 3


def test_ramps_to_some_levels_are_longer():
    plan = _plan(ramp_factors=[1, 2.5, 1], direction="up-down")
    ramps = {s.level: s.periods for s in plan.segments(5000.0) if s.kind is SegmentKind.RAMP}
    assert ramps == {0.4: 20.0, 0.2: 50.0, 0.6: 20.0}
    resumed = plan.segments(5000.0, done=frozenset({0, 1, 2, 3}))
    assert [s.periods for s in resumed if s.kind is SegmentKind.RAMP] == [20.0, 50.0]


@pytest.mark.parametrize(("factors", "field"), [([1, 2], "ramp_factors"), ([1, 2, 0.01], "ramp_factors[2]")])
def test_factors_of_ramps_that_do_not_fit_are_refused(factors, field):
    with refused(ConfigurationError, field=field):
        plan_from(_plan().model_dump(mode="json", exclude_none=True) | {"ramp_factors": factors}, "plan")


def test_a_resumed_point_is_approached_from_the_level_before():
    segments = _plan().segments(5000.0, done=frozenset({0, 1}))
    assert [(s.kind, s.level) for s in segments[:3]] == [
        (SegmentKind.RAMP, 0.4),
        (SegmentKind.HOLD, 0.4),
        (SegmentKind.RAMP, 0.6),
    ]
    assert {s.point for s in segments} == {-1, 2}


def test_a_resumed_point_on_the_way_down_is_approached_from_above():
    segments = _plan(direction="up-down").segments(5000.0, done=frozenset({0, 1, 2, 3}))
    assert [s.level for s in segments if s.kind is SegmentKind.RAMP] == [0.4, 0.2]


def test_a_finished_plan_has_no_segments_left():
    assert _plan().segments(5000.0, done=frozenset({0, 1, 2})) == ()


@pytest.mark.parametrize("name", shipped_plans())
def test_a_shipped_plan_fits_its_bench(name):
    plan = load_plan(name)
    bench = bench_of(plan, name)
    plan.check(bench)
    assert name.split("/")[0] == bench.name
    assert bench.name in shipped_benches()
    assert plan.description


@pytest.mark.parametrize("name", [name for name in shipped_plans() if "/backbone" in name and "short" not in name])
def test_a_shipped_backbone_holds_the_gains_of_the_paper(name):
    plan = load_plan(name)
    specimen = "friction-beam" if name.startswith("friction-beam") else "magnet-beam"
    paper = preset(specimen, "backbone", "A" if "sign" in name else "B")
    for gain in ("detector", "low_pass_rad_s", "k1", "k2", "centre_frequency_hz", "phase_lag_deg", "lock"):
        assert getattr(plan.controller, gain) == getattr(paper, gain)
    assert plan.controller.frequency_window_hz == pytest.approx(paper.frequency_window_hz)


def test_a_bench_file_is_looked_for_beside_the_plan(tmp_path):
    from rig.campaigns import plans

    (tmp_path / "bench.toml").write_text(
        (plans._folder().parents[1] / "bench" / "shipped" / "magnet-beam.toml").read_text()
    )
    assert bench_of(_plan(bench="bench.toml"), tmp_path / "plan.toml").name == "magnet-beam"
