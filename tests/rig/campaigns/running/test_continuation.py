"""Which points of a changed plan are old ones, which are new, and which number each has in the recording."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, strategies as st

from controller import preset
from rig.bench import load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.evaluation.stored_point import stored
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.continuation import changed_keys, identities, numbered, remaining
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.campaigns.sweep.plan import SweepPlan
from rig.errors import ConfigurationError
from tests.refused import refused
from tests.rig.campaigns.made_points import made_point

LAW = preset("magnet-beam").model_dump()


def backbone(**changes):
    return BackbonePlan.model_validate({"bench": "magnet-beam", "controller": LAW, "levels_v": (0.2, 0.4)} | changes)


def sines(frequencies_hz, levels_v=(0.4,)):
    return SteppedSinePlan(bench="magnet-beam", levels_v=levels_v, frequencies_hz=tuple(frequencies_hz))


backbones = st.builds(
    lambda levels, direction, repeats, k1, lag: backbone(
        levels_v=tuple(level / 10 for level in levels),
        direction=direction,
        repeats=repeats,
        controller=LAW | {"k1": k1, "phase_lag_deg": lag},
    ),
    st.lists(st.integers(1, 12), min_size=1, max_size=5, unique=True),
    st.sampled_from(["up", "down", "up-down"]),
    st.integers(1, 3),
    st.sampled_from([1.0, 2.0]),
    st.sampled_from([-90.0, -80.0]),
)


def physical(plan):
    """What the points of a backbone with different levels are, written down independently of the code that matches them."""
    lag = plan.controller.phase_lag_deg
    return [(round(t.level, 3), t.direction, t.repeat, lag) for t in plan.targets()]


@given(st.lists(backbones, min_size=1, max_size=6))
def test_over_any_changes_a_point_keeps_its_number_and_no_two_points_share_one(history):
    plans = [(history[0], None)]
    number_of = dict(zip(physical(history[0]), range(len(history[0].targets())), strict=True))
    for plan in history[1:]:
        numbers = numbered(plans, plan)
        for what, number in zip(physical(plan), numbers, strict=True):
            assert number_of.setdefault(what, number) == number
        plans.append((plan, numbers))
    assert sorted(number_of.values()) == list(range(len(number_of)))


@given(st.lists(st.sampled_from([23.0, 23.5, 24.0, 24.5]), min_size=1, max_size=8), st.data())
def test_frequencies_that_come_again_are_points_of_their_own(frequencies, data):
    plan = sines(frequencies)
    assert len(set(identities(plan))) == len(frequencies)
    shorter = sines(frequencies[: data.draw(st.integers(1, len(frequencies)))])
    if shorter.targets()[0].direction == plan.targets()[0].direction:
        numbers = numbered([(plan, None)], shorter)
        assert numbers == tuple(range(len(shorter.targets())))


@given(st.floats(1e-3, 9.0), st.floats(21.0, 29.0))
def test_the_last_bits_of_a_number_make_no_new_point(level, frequency_hz):
    level, frequency_hz = float(f"{level:.6g}"), float(f"{frequency_hz:.6g}")  # as it is typed
    near = sines([math.nextafter(frequency_hz, 99.0)], (math.nextafter(level, 0.0),))
    assert numbered([(sines([frequency_hz], (level,)), None)], near) == (0,)
    assert numbered([(sines([frequency_hz], (level,)), None)], sines([frequency_hz * 1.00001], (level,))) == (1,)


def test_start_stop_and_a_list_of_the_same_frequencies_are_the_same_points():
    spaced = SteppedSinePlan(bench="magnet-beam", levels_v=(0.4,), start_hz=23.0, stop_hz=24.0, steps=11)
    listed = sines([23.0 + k / 10 for k in range(11)])
    assert numbered([(spaced, None)], listed) == tuple(range(11))


SWEEP = {"bench": "magnet-beam", "levels_v": (0.4, 0.8), "start_hz": 22.0, "stop_hz": 26.0, "rate_hz_per_s": 1.0}
MULTISINE = {
    "bench": "magnet-beam",
    "levels_rms_v": (0.1,),
    "lowest_hz": 22.0,
    "highest_hz": 28.0,
    "resolution_hz": 0.5,
    "realisations": 3,
}


@pytest.mark.parametrize(
    ("before", "change", "kept"),
    [
        (backbone(), {"settle": {"settled_periods": 30}, "record_periods": 9, "ramp_periods": 5.0}, 2),
        (backbone(), {"controller": LAW | {"k1": 1.0}}, 2),
        (backbone(), {"controller": LAW | {"phase_lag_deg": -85.0}}, 0),
        (backbone(), {"direction": "down"}, 0),
        (backbone(), {"direction": "up-down"}, 2),
        (backbone(), {"repeats": 2}, 2),
        (SweepPlan(**SWEEP), {"levels_v": (0.8, 0.2)}, 1),
        (SweepPlan(**SWEEP), {"rate_hz_per_s": 0.5}, 0),
        (SweepPlan(**SWEEP), {"start_hz": 21.0}, 0),
        (SweepPlan(**SWEEP), {"hold_periods": 40.0}, 2),
        (MultisinePlan(**MULTISINE), {"realisations": 5}, 3),
        (MultisinePlan(**MULTISINE), {"periods": 8, "transient_periods": 4}, 3),
        (MultisinePlan(**MULTISINE), {"phase_seed": 1}, 0),
        (MultisinePlan(**MULTISINE), {"grid": "odd-random"}, 0),
        (MultisinePlan(**MULTISINE), {"highest_hz": 29.0}, 0),
    ],
)
def test_what_makes_other_points_and_what_does_not(before, change, kept):
    after = type(before).model_validate(before.model_dump() | change)
    old = set(range(len(before.targets())))
    assert len(old & set(numbered([(before, None)], after))) == kept


def recording(tmp_path, *plans, points=()):
    """What is asked of a recording: its plans with their numbers, and its points."""
    said = [
        SimpleNamespace(part=part, plan=plan.model_dump(mode="json"), numbers=numbers)
        for part, (plan, numbers) in enumerate(plans)
    ]
    configuration = {"bench": load_bench("magnet-beam").model_dump(mode="json")}
    return SimpleNamespace(path=tmp_path / "run.h5", plans=said, configuration=configuration, points=points)


@given(
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.lists(st.integers(1, 6), min_size=1, max_size=6, unique=True),
)
def test_what_is_done_is_what_was_accepted_and_is_asked_for(tmp_path_factory, accepted, levels):
    before = backbone(levels_v=(0.1, 0.2, 0.3))
    qualities = [Quality.GOOD if good else Quality.REJECTED for good in accepted]
    points = [stored(made_point(quality=quality, number=number)) for number, quality in enumerate(qualities)]
    change = backbone(levels_v=tuple(level / 10 for level in levels))
    left = remaining(recording(tmp_path_factory.getbasetemp(), (before, None), points=points), change)
    good = {level for level, ok in zip((0.1, 0.2, 0.3), accepted, strict=True) if ok}
    done = {change.targets()[place].level for place in left.done}
    assert done == good & set(change.levels)
    to_measure = {left.plan.targets()[s.point].level for s in left.plan.segments(5000.0, left.done) if s.point >= 0}
    assert to_measure == set(change.levels) - good


def test_the_plan_in_force_given_again_is_no_change(tmp_path):
    left = remaining(recording(tmp_path, (backbone(), None)), backbone())
    assert not left.changed
    assert left.information() == {}


OTHER_BENCH = backbone(bench="friction-beam", controller=preset("friction-beam").model_dump())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (sines([24.0]), {"field": "kind", "value": "stepped-sine", "allowed": "'backbone', the kind of run.h5"}),
        (OTHER_BENCH, {"says": "friction-beam-allowed-magnet-beam-on", "field": "bench", "value": "friction-beam"}),
        (backbone(levels_v=None, levels_n=(0.1,)), {"says": "mine-toml-levels-in-allowed-are"}),
        (backbone(harmonics=9), {"field": "harmonics", "value": 9, "allowed": "7, with which run.h5 was begun"}),
        (
            backbone(levels_v=(0.2, 12.0)),
            {"says": "the-bench-magnet-beam-allows-up-2", "field": "levels_v[1]", "value": 12.0},
        ),
    ],
)
def test_a_plan_that_cannot_follow_is_refused_in_one_line(tmp_path, change, message):
    with refused(ConfigurationError, **message):
        remaining(recording(tmp_path, (backbone(), None)), change, "mine.toml")


def test_a_bench_file_of_the_same_bench_is_the_same_bench(tmp_path):
    from importlib import resources

    text = (resources.files("rig.bench") / "shipped" / "magnet-beam.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text)
    change = backbone(bench="mine.toml", levels_v=(0.9,))
    assert remaining(recording(tmp_path, (backbone(), None)), change, tmp_path / "plan.toml").changed


def test_changed_keys_are_named_by_their_path():
    before, after = backbone(), backbone(controller=LAW | {"k1": 1.0, "k2": 3.0}, levels_v=(0.2,))
    assert changed_keys(before.model_dump(), after.model_dump()) == ["controller.k1", "controller.k2", "levels_v"]
