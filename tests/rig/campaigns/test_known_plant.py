"""A plan that knows its plant refuses what cannot be on it, before anything moves."""

import math

import pytest

from rig.bench import load_bench
from rig.campaigns.plans import plan_from
from rig.errors import ConfigurationError
from tests.controller.tuning.rigs import plant_of

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
    with pytest.raises(ConfigurationError, match=r"unstable on the known plant .* growing at [\d.]+ 1/s"):
        plan.check(bench)


def test_nothing_is_refused_without_a_plant():
    plan, bench = plan_for("magnet-beam", controller={"drive_mode_shape": 3.0}, plant=False)
    plan.check(bench)


def test_the_closed_form_fails_on_the_friction_beam_and_the_papers_gains_do_not():
    voltage = {"detector": "two-phase", "frequency_law": "phase", "low_pass_rad_s": 2 * math.pi}
    plan, bench = plan_for("friction-beam", controller={**voltage, "k1": 1.0, "k2": 10 * math.pi}, levels_v=[0.1])
    plan.check(bench)
    plan, bench = plan_for("friction-beam", controller={**voltage, "k1": 7.7, "k2": 3000.0}, levels_v=[0.1])
    with pytest.raises(ConfigurationError, match="unstable on the known plant"):
        plan.check(bench)


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ({"levels_m": [1e-4, 5.9e-3]}, None),
        ({"levels_n": [0.1, 3.0]}, r"levels_n\[1\] = 3 N: needs 19\.\d V .* allows 9\.5 V"),
        ({"levels_rms_n": [2.0]}, r"levels_rms_n\[0\] = 2 N RMS: needs 18\.\d V"),
        ({"levels_v": [9.0]}, None),
    ],
)
def test_levels_beyond_the_voltage_limit_are_refused_with_the_voltage(levels, said):
    plan, bench = plan_for("magnet-beam", controller={"k4": 0.5}, **levels)
    if said is None:
        plan.check(bench)
    else:
        with pytest.raises(ConfigurationError, match=said):
            plan.check(bench)


def test_a_plant_with_a_wrong_key_is_named():
    table = plan_for("magnet-beam")[0].model_dump(mode="json")
    table["plant"]["damping"] = 0.1
    with pytest.raises(ConfigurationError, match=r"plant\.damping: unknown key"):
        plan_from(table, "plan")
