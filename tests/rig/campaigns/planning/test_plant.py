"""A plan that knows its plant refuses what cannot be on it, before anything moves."""

import math
import re

import pytest

from rig.bench import load_bench
from rig.campaigns.planning.levels_on_plant import motion_for, voltage_for
from rig.campaigns.plans import load_plan, plan_from
from rig.errors import ConfigurationError
from tests.controller.tuning.rigs import plant_of
from tests.refused import refused

LINEAR_HZ = {"magnet-beam": 24.37, "friction-beam": 149.0}


def plan_for(name, *, controller=None, plant=True, **levels):
    """A backbone with complex response control, a frequency-error loop, and the plant as the rig's own."""
    hertz, model = LINEAR_HZ[name], plant_of(name)
    low_pass = 2 * math.pi * hertz / 5
    pole = model.pole_offset_rad_s()
    table = {
        "kind": "backbone",
        "bench": name,
        "start_v": 0.1,
        **(levels or {"levels_m": [2e-5, 5e-5]}),
        "controller": {
            "detector": "adaptive",
            "low_pass_rad_s": low_pass,
            "frequency_law": "frequency-error",
            "frequency_integral_per_s": low_pass / 16,
            "response_integral_per_s": low_pass / 4,
            "plant_pole_rad_s": [pole.real, pole.imag],
            "centre_frequency_hz": hertz,
            "frequency_window_hz": [0.9 * hertz, 1.1 * hertz],
            **(controller or {}),
        },
    }
    return plan_from(table | ({"plant": model.to_dict()} if plant else {}), "plan"), load_bench(name)


@pytest.mark.parametrize("name", LINEAR_HZ)
@pytest.mark.parametrize("factor", [0.7, 1.0, 1.5])
def test_a_mode_shape_that_is_wrong_by_half_passes(name, factor):
    shape = factor * plant_of(name).drive_shape
    plan, bench = plan_for(name, controller={"drive_mode_shape": shape})
    plan.check(bench)


@pytest.mark.parametrize("name", LINEAR_HZ)
def test_a_mode_shape_that_is_far_too_large_is_refused_with_the_growth(name):
    shape = 3.5 * plant_of(name).drive_shape
    plan, bench = plan_for(name, controller={"drive_mode_shape": shape})
    with refused(ConfigurationError, "unstable-on-the-known-plant-growing", field="controller"):
        plan.check(bench)


def test_nothing_is_refused_without_a_plant():
    plan, bench = plan_for("magnet-beam", controller={"drive_mode_shape": 3.0}, plant=False)
    plan.check(bench)


def test_the_closed_form_fails_on_the_friction_beam_and_the_papers_gains_do_not():
    voltage = {"detector": "two-phase", "frequency_law": "phase", "low_pass_rad_s": 2 * math.pi}
    plan, bench = plan_for("friction-beam", controller={**voltage, "k1": 1.0, "k2": 10 * math.pi}, levels_v=[0.1])
    plan.check(bench)
    plan, bench = plan_for("friction-beam", controller={**voltage, "k1": 7.7, "k2": 3000.0}, levels_v=[0.1])
    with refused(ConfigurationError, "unstable-on-the-known-plant", field="controller"):
        plan.check(bench)


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ({"levels_m": [1e-4, 3.7e-3]}, None),
        ({"levels_n": [0.1, 3.0]}, {"field": "levels_n[1]", "value": 3.0}),
        ({"levels_rms_n": [2.0]}, {"field": "levels_rms_n[0]", "value": 2.0}),
        ({"levels_v": [7.0]}, None),
    ],
)
def test_levels_beyond_the_voltage_limit_are_refused_with_the_voltage(levels, said):
    plan, bench = plan_for("magnet-beam", controller={"k4": 0.5}, **levels)
    if said is None:
        plan.check(bench)
    else:
        with refused(ConfigurationError, **said):
            plan.check(bench)


def phases_for(kind, lags, *, controller=None, name="friction-beam", **levels):
    """A shipped plan that steps the phase, with other lags and the rig's own plant."""
    table = load_plan(f"{name}/{kind}").model_dump(mode="json", exclude_none=True)
    for key in ("start_deg", "stop_deg"):
        table.pop(key, None)
    table["controller"] |= {"rest_low_pass_rad_s": 0.0, **(controller or {})}
    table |= {"phase_lags_deg": lags, "plant": plant_of(name).to_dict(), **levels}
    return plan_from(table, "plan"), load_bench(name)


LOGARITHMIC = {"force_loop": "logarithmic", "force_proportional": 0.3, "force_integral_per_s": 2.0}


def test_a_phase_that_a_force_loop_cannot_hold_is_refused_with_its_lag_and_the_others_pass():
    plan, bench = phases_for("stepped-phase-fast", [-90.0, -60.0], controller=LOGARITHMIC, levels_n=[0.1])
    plan.check(bench)
    plan, bench = phases_for("stepped-phase-fast", [-120.0, -90.0], controller=LOGARITHMIC, levels_n=[0.1])
    with refused(ConfigurationError, "unstable-at-lag-of-deg-growing", field="controller"):
        plan.check(bench)
    many = phases_for("stepped-phase-fast", [-160.0, -150.0, -140.0, -130.0, -90.0], controller=LOGARITHMIC)
    with refused(ConfigurationError, "at-lags-from-to-deg", field="controller"):
        many[0].check(many[1])


def test_the_phases_that_the_papers_force_loop_loses_on_the_friction_beam_are_refused():
    plan, bench = phases_for("stepped-phase-paper", [-150.0, -140.0, -130.0, -100.0, -60.0, -30.0])
    with refused(ConfigurationError, "at-lag-of-deg", field="controller"):
        plan.check(bench)
    plan, bench = phases_for("stepped-phase-paper", [-100.0, -60.0, -30.0])
    plan.check(bench)


def test_the_lag_at_which_levels_are_reached_is_checked_too():
    plan, bench = phases_for("stepped-phase-fast", [-90.0], controller=LOGARITHMIC, levels_n=[0.1], approach_deg=-150.0)
    with refused(ConfigurationError, "at-lag-of-deg-2", field="controller"):
        plan.check(bench)


def test_the_loop_of_a_held_response_is_checked_at_every_lag():
    plan, bench = phases_for("response-controlled", [-150.0, -90.0], levels_m=[1e-5])
    plan.check(bench)
    quick = {"response_integral_per_s": 3000.0}
    plan, bench = phases_for("response-controlled", [-150.0, -90.0], controller=quick, levels_m=[1e-5])
    with refused(ConfigurationError, "the-response-loop-is-too-quick", field="controller"):
        plan.check(bench)


@pytest.mark.parametrize(("k2", "k4"), [(6280.0, 1.0), (6280.0, 500.0), (6.28, 500.0 * 1.5)])
def test_the_papers_gains_a_hundred_times_as_large_are_refused_on_the_magnet_beam(k2, k4):
    lags = [-150.0, -90.0, -30.0]
    phases_for("stepped-phase-paper", lags, name="magnet-beam")[0].check(load_bench("magnet-beam"))
    plan, bench = phases_for("stepped-phase-paper", lags, name="magnet-beam", controller={"k2": k2, "k4": k4})
    with refused(ConfigurationError, "unstable-is-too-quick-on-the", field="controller"):
        plan.check(bench)


def test_a_loop_that_is_too_quick_is_refused_with_its_gain_at_half_the_frequency():
    plan, bench = plan_for("magnet-beam", controller={"response_integral_per_s": 2000.0})
    with refused(ConfigurationError, "the-response-loop-is-too-quick-2", field="controller"):
        plan.check(bench)


@pytest.mark.parametrize("name", LINEAR_HZ)
@pytest.mark.parametrize(
    "kind",
    ["stepped-phase-fast", "stepped-phase", "response-controlled", "backbone-short", "continuous-backbone"],
)
def test_shipped_plans_pass_with_their_plant(name, kind):
    table = load_plan(f"{name}/{kind}").model_dump(mode="json", exclude_none=True)
    plan_from(table | {"plant": plant_of(name).to_dict()}, "plan").check(load_bench(name))


@pytest.mark.parametrize("name", LINEAR_HZ)
@pytest.mark.parametrize(("key", "factor"), [("response_integral_per_s", 30.0), ("frequency_integral_per_s", 60.0)])
def test_the_loops_inside_a_force_loop_by_the_force_at_rest_are_checked(name, key, factor):
    table = load_plan(f"{name}/stepped-phase-fast").model_dump(mode="json", exclude_none=True)
    assert table["controller"]["rest_low_pass_rad_s"] > 0.0
    table["controller"][key] *= factor
    plan = plan_from(table | {"plant": plant_of(name).to_dict()}, "plan")
    with refused(ConfigurationError, "on-the-known-plant", field="controller"):
        plan.check(load_bench(name))


@pytest.mark.parametrize(
    ("limit", "value", "levels", "said"),
    [
        (
            "force_n",
            0.5,
            {"levels_m": [1e-3, 3.5e-3]},
            {"says": "means-on-or-more", "field": "levels_m[1]", "value": 0.0035},
        ),
        (
            "acceleration_m_s2",
            50.0,
            {"levels_m": [1e-3, 3.5e-3]},
            {"says": "means-at-channel-acc-magnet-2", "field": "levels_m[1]", "value": 0.0035},
        ),
        (
            "displacement_m",
            2e-4,
            {"levels_n": [0.1, 0.55]},
            {"says": "means-at-channel-acc-magnet-on-2", "field": "levels_n[1]", "value": 0.55},
        ),
        ("displacement_m", 5e-4, {"levels_n": [0.1, 0.55]}, None),  # a joint of eight times the damping would do
        (
            "acceleration_m_s2",
            5.0,
            {"levels_rms_n": [0.39]},
            {"says": "means-at-channel-acc-magnet-on-3", "field": "levels_rms_n[0]", "value": 0.39},
        ),
        ("displacement_m", 5e-4, {"levels_v": [0.5]}, None),
        (
            "displacement_m",
            4e-4,
            {"levels_v": [0.5]},
            {"says": "means-at-channel-acc-magnet-on", "field": "levels_v[0]", "value": 0.5},
        ),
        (
            "force_n",
            0.07,
            {"levels_v": [0.5]},
            {"says": "means-on-the-known-plant", "field": "levels_v[0]", "value": 0.5},
        ),
    ],
)
def test_levels_beyond_the_limits_of_force_and_motion_are_refused_with_the_number(limit, value, levels, said):
    plan, bench = plan_for("magnet-beam", controller={"k4": 0.5}, **levels)
    plan.check(bench)
    narrow = bench.limits.model_copy(update={limit: value})
    bench = bench.model_copy(update={"limits": narrow})
    if said is None:
        plan.check(bench)
    else:
        with refused(ConfigurationError, **said):
            plan.check(bench)


def test_force_and_motion_of_a_level_are_those_of_one_mode_at_resonance():
    plant = plant_of("magnet-beam")
    found = motion_for(plant, 0.55, "N", -90.0)
    one_mode = 0.55 * plant.drive_shape**2 / (2.0 * plant.damping_ratio * plant.frequency_rad_s**2)
    assert found["displacement_m"] == pytest.approx(one_mode, rel=1e-2)
    assert found["acceleration_m_s2"] == pytest.approx(one_mode * plant.frequency_rad_s**2, rel=1e-2)
    back = motion_for(plant, found["displacement_m"], "m", -90.0)
    assert back["force_n"] == pytest.approx(0.55)
    assert motion_for(plant, 0.55 / math.sqrt(2.0), "N RMS", -90.0)["force_n"] == pytest.approx(0.55)


def test_the_voltage_that_a_level_needs_is_that_of_the_lag_that_takes_most():
    bench, plant = load_bench("friction-beam"), plant_of("friction-beam")
    lags = [-150.0, -90.0, -60.0]
    volts = [voltage_for(plant, 9e-4, "m", lag) for lag in lags]
    at = lags[volts.index(max(volts))]
    assert at != -90.0
    limit = 0.5 * (max(volts) + voltage_for(plant, 9e-4, "m", -90.0))
    bench = bench.model_copy(
        update={"limits": bench.limits.model_copy(update={"voltage_v": limit, "acceleration_m_s2": 1e3})}
    )
    phases_for("response-controlled", [-90.0], levels_m=[9e-4])[0].check(bench)
    with refused(ConfigurationError, field="levels_m[0]", reason=lambda text: f"V at a lag of {at:g} deg" in text):
        phases_for("response-controlled", lags, levels_m=[9e-4])[0].check(bench)


@pytest.mark.parametrize("kind", ["backbone", "stepped-phase-fast", "response-controlled", "continuous-backbone"])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"frequency_window_hz": [24.6, 26.0], "centre_frequency_hz": 25.0},
            {"says": "linear-frequency-hz", "field": "controller.frequency_window_hz", "value": [24.6, 26.0]},
        ),
        (
            {"frequency_window_hz": [0.1, 90.0]},
            {"says": "the-bench-magnet-beam-allows", "field": "controller.frequency_window_hz", "value": [0.1, 90.0]},
        ),
        (
            {"harmonics": 50, "frequency_window_hz": [21.0, 60.0]},
            {"field": "harmonics", "value": 50, "allowed": "up to 39 of 60 Hz at 5000 samples/s"},
        ),
    ],
)
def test_every_campaign_under_a_lock_checks_window_and_harmonics(kind, change, said):
    table = load_plan(f"magnet-beam/{kind}").model_dump(mode="json", exclude_none=True)
    own = {key: value for key, value in change.items() if key == "harmonics"}
    table["controller"] |= {key: value for key, value in change.items() if key != "harmonics"}
    with refused(ConfigurationError, **said):
        plan_from(table | own, "plan").check(load_bench("magnet-beam"))


def test_a_plant_with_a_wrong_key_is_named():
    table = plan_for("magnet-beam")[0].model_dump(mode="json")
    table["plant"]["damping"] = 0.1
    with refused(ConfigurationError, "unknown-key", field="plant.damping"):
        plan_from(table, "plan")


@pytest.mark.parametrize(("highest_hz", "spare"), [(1000.0, 2), (3000.0, 2), (2000.0, 1), (500000.0, 1)])
def test_a_frequency_too_high_for_any_harmonic_is_named_with_the_highest_allowed(highest_hz, spare):
    plan, bench = load_plan("magnet-beam/backbone"), load_bench("magnet-beam")
    with refused(ConfigurationError, field="highest frequency", value=highest_hz, unit="Hz") as caught:
        plan.check_evaluated(7, bench, highest_hz, spare)
    allowed_hz = float(caught.value.allowed.split()[-2])
    plan.check_evaluated(1, bench, allowed_hz, spare)


@pytest.mark.parametrize("name", LINEAR_HZ)
def test_gains_that_do_not_bear_a_longer_delay_are_refused_with_the_longest_that_they_bear(name):
    plan, bench = plan_for(name)
    known_s = plan.plant.model.delay_s
    plan.check_delay(bench, known_s * bench.sample_rate_hz)
    with refused(ConfigurationError, "frequency-proportional", field="controller") as caught:
        plan.check_delay(bench, 10.0 * bench.sample_rate_hz / LINEAR_HZ[name])
    said = str(caught.value)
    assert "response_integral_per_s = " in said
    longest_s = 1e-3 * float(re.search(r"allowed: up to ([\d.]+) ms", said).group(1))
    assert known_s < longest_s < 10.0 / LINEAR_HZ[name]
    assert plan.longest_delay_s(bench, 1.0) == pytest.approx(longest_s, rel=0.01)
    assert plan.longest_delay_s(bench, known_s) == known_s
    plan.check_delay(bench, 0.98 * longest_s * bench.sample_rate_hz)
    with pytest.raises(ConfigurationError):
        plan.check_delay(bench, 1.03 * longest_s * bench.sample_rate_hz)


def test_a_plan_as_tuned_is_not_judged_anew_at_its_own_delay():
    shape = 3.5 * plant_of("magnet-beam").drive_shape  # unstable, which `check` says
    plan, bench = plan_for("magnet-beam", controller={"drive_mode_shape": shape})
    plan.check_delay(bench, plan.plant.model.delay_s * bench.sample_rate_hz)


def test_without_a_plant_the_bound_of_the_gains_holds():
    plan, bench = plan_for("friction-beam", plant=False)
    longest_s = plan.longest_delay_s(bench, 1.0)
    assert longest_s == plan.controller.longest_delay_s(plan.amplitude_law)
    plan.check_delay(bench, 0.999 * longest_s * bench.sample_rate_hz)
    parts = {
        "says": "controller-response-integral-per-ms-from",
        "field": "controller.response_integral_per_s = 46.8097",
    }
    with refused(ConfigurationError, **parts):
        plan.check_delay(bench, 1.001 * longest_s * bench.sample_rate_hz)


@pytest.mark.parametrize(("periods", "said"), [(0.5, False), (0.74, False), (0.76, True), (2.5, True)])
def test_a_delay_with_which_a_loop_may_hunt_is_told_where_no_plant_proves_the_gains(periods, said):
    plan, bench = load_plan("magnet-beam/backbone"), load_bench("magnet-beam")
    delay_s = periods / bench.specimen.linear_frequency_hz
    remark = plan.remark_on_delay(bench, delay_s)
    assert (f"is {periods:.2g} periods of the specimen" in remark) is said
    assert bool(remark) is said
    assert plan_for("magnet-beam")[0].remark_on_delay(bench, delay_s) == ""


def test_the_harmonics_loop_is_judged_at_the_delay_of_the_device():
    plan = load_plan("friction-beam/backbone-pure")
    bench = load_bench(plan.bench)
    longest_s = plan.longest_delay_s(bench, 1.0)
    plan.check_delay(bench, 0.999 * longest_s * bench.sample_rate_hz)
    parts = {"says": "its-phase-margin-deg", "field": "controller.harmonics.integral", "value": 0.04}
    with refused(ConfigurationError, **parts):
        plan.check_delay(bench, 1.001 * longest_s * bench.sample_rate_hz)


@pytest.mark.parametrize(
    ("name", "feedback"),
    [
        ("magnet-beam/backbone", True),
        ("magnet-beam/multisine-1", False),
        ("magnet-beam/sweep-1", False),
        ("magnet-beam/controlled-sweep-up", True),
        ("magnet-beam/decay", True),
    ],
)
def test_plans_without_feedback_are_those_whose_outputs_answer_nothing(name, feedback):
    assert load_plan(name).feedback is feedback
