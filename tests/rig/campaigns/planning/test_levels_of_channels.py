"""Levels are checked at every channel whose motion in the mode under test is known, by shapes or by a measurement."""

import pytest

from rig.bench import load_bench
from rig.campaigns.plans import load_plan, plan_from
from rig.errors import ConfigurationError
from tests.controller.tuning.rigs import plant_of
from tests.refused import refused

KINDS = ["backbone-short", "response-controlled", "continuous-backbone"]
RATIO = 1.444326 / 0.908466  # of the bench's mode shapes


def plan_of(kind, **changes):
    table = load_plan(f"magnet-beam/{kind}").model_dump(mode="json", exclude_none=True)
    return plan_from(table | changes, "plan")


def tone(kind, band_hz, level_m):
    table = load_plan(f"magnet-beam/{kind}").model_dump(mode="json", exclude_none=True)
    del table["levels_n"]
    table |= {"levels_m": [level_m], "start_v": 0.1, "start_hz": band_hz[0], "stop_hz": band_hz[1]}
    return plan_from(table, "plan")


@pytest.mark.parametrize("kind", KINDS)
def test_a_level_that_takes_a_channel_beyond_its_limit_by_the_mode_shapes_is_refused_without_a_plant(kind):
    bench = load_bench("magnet-beam")
    plan_of(kind, levels_m=[1e-3, 3.3e-3]).check(bench)
    with refused(ConfigurationError, "means-at-channel-acc-magnet-which", field="levels_m[1]", value=0.004):
        plan_of(kind, levels_m=[1e-3, 4e-3]).check(bench)


def test_the_acceleration_of_a_level_is_checked_at_the_linear_frequency():
    bench = load_bench("magnet-beam")
    narrow = bench.model_copy(update={"limits": bench.limits.model_copy(update={"acceleration_m_s2": 70.0})})
    plan_of("backbone-short", levels_m=[1e-3, 1.8e-3]).check(narrow)
    with refused(ConfigurationError, "means-at-channel-acc-magnet", field="levels_m[1]", value=0.002):
        plan_of("backbone-short", levels_m=[1e-3, 2e-3]).check(narrow)


@pytest.mark.parametrize("kind", ["stepped-sine-up", "controlled-sweep-up"])
def test_in_open_loop_the_shapes_count_where_the_band_holds_the_mode(kind):
    bench = load_bench("magnet-beam")
    tone(kind, (23.8, 25.6), 3.7e-3).check(bench)
    tone(kind, (30.0, 35.0), 4e-3).check(bench)
    with refused(ConfigurationError, "at-channel-acc-magnet", field="levels_m[0]", value=0.004):
        tone(kind, (23.8, 25.6), 4e-3).check(bench)


def test_without_mode_shapes_only_the_drive_point_is_checked():
    bench = load_bench("magnet-beam")
    unknown = bench.model_copy(update={"specimen": bench.specimen.model_copy(update={"drive_mode_shape": None})})
    plan_of("response-controlled", levels_m=[5.9e-3]).check(unknown)
    assert unknown.response_ratios == {"drive": 1.0}
    assert bench.response_ratios["acc_magnet"] == pytest.approx(RATIO)


@pytest.mark.parametrize(("measured", "level_m"), [(3.0, 2.1e-3), (1.2, 5.2e-3)])
def test_a_measured_ratio_takes_the_place_of_the_mode_shape(measured, level_m):
    bench = load_bench("magnet-beam")
    plant = plant_of("magnet-beam").to_dict() | {"response_ratios": {"acc_magnet": measured}}
    plan_of("backbone-short", levels_m=[0.9 * level_m], plant=plant).check(bench)
    with refused(
        ConfigurationError, field="levels_m[0]", reason=lambda text: f"which moves {measured:g} times" in text
    ):
        plan_of("backbone-short", levels_m=[level_m], plant=plant).check(bench)


def test_a_ratio_of_a_channel_that_the_bench_does_not_have_is_refused():
    plant = plant_of("magnet-beam").to_dict() | {"response_ratios": {"tip": 5.0}}
    with refused(ConfigurationError, "magnet-beam-acc-drive-acc-magnet", field="plant.response_ratios.tip"):
        plan_of("backbone-short", plant=plant).check(load_bench("magnet-beam"))


def test_a_ratio_that_is_none_is_refused_when_the_plan_is_read():
    plant = plant_of("magnet-beam").to_dict() | {"response_ratios": {"acc_magnet": -1.0}}
    with refused(ConfigurationError, field="plant.response_ratios.acc_magnet", value=-1.0):
        plan_of("backbone-short", plant=plant)


def test_a_standard_error_of_no_ratio_is_refused_when_the_plan_is_read():
    plant = plant_of("magnet-beam").to_dict() | {
        "response_ratios": {"acc_magnet": 1.6},
        "response_ratio_stds": {"tip": 0.1},
    }
    with refused(
        ConfigurationError, field="plant.response_ratio_stds.tip", allowed="a channel of response_ratios: acc_magnet"
    ):
        plan_of("backbone-short", plant=plant)


@pytest.mark.parametrize("name", ["magnet-beam", "magnet-beam-symmetric", "friction-beam"])
def test_the_ratios_of_the_shipped_benches_are_those_of_their_shapes(name):
    ratios = load_bench(name).response_ratios
    assert ratios["drive"] == 1.0
    assert len(ratios) == 3
