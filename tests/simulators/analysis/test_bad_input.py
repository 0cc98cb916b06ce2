import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from simulators.analysis.harmonic_balance import constant_force_response, forced_response, phase_resonance_backbone
from simulators.analysis.responses import NotConvergedError
from simulators.analysis.site_forces import hysteresis_loops
from simulators.layout import Flag
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.analysis.rigs import one_mode
from tests.simulators.references import ideal
from vibrolock.content_cache import c_function


@c_function("float64(float64, CPointer(float64))")
def nan_beyond_ten_micrometres(z: float, parameters: Any) -> float:
    return math.nan if z > 1e-5 else 0.0


BAD: list[tuple[Callable[..., Any], dict[str, Any], str]] = [
    (phase_resonance_backbone, {"forces_n": [0.1, 0.0]}, {"field": "forces_n", "value": 0.0, "allowed": "above 0"}),
    (phase_resonance_backbone, {"forces_n": [np.nan]}, {"field": "forces_n", "allowed": "above 0"}),
    (
        phase_resonance_backbone,
        {"forces_n": []},
        {"says": "shape-2", "field": "forces_n", "allowed": "one row of at least one number"},
    ),
    (phase_resonance_backbone, {"voltages_v": [-1.0]}, {"field": "voltages_v", "value": -1.0, "allowed": "above 0"}),
    (
        phase_resonance_backbone,
        {},
        {"says": "several-or-none-given", "field": "forces_n, voltages_v, amplitudes_m", "allowed": "one of them"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "phase_lag_deg": 90.0},
        {"field": "phase_lag_deg", "value": 90.0, "allowed": "-179 to -1"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "harmonics": 0},
        {"field": "harmonics", "value": 0, "allowed": "1 and above"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "samples": 32},
        {"field": "samples", "value": 32, "allowed": "at least 64 for 15 harmonics"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "near_hz": 0.0},
        {"field": "near_hz", "value": 0.0, "allowed": "above 0"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": ["a"]},
        {"field": "forces_n", "value": ["a"], "allowed": "a number, or one row of numbers"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [1j]},
        {"field": "forces_n", "value": [1j], "allowed": "a number, or one row of numbers"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "harmonics": 3.5},
        {"field": "harmonics", "value": 3.5, "allowed": "a whole number"},
    ),
    (
        phase_resonance_backbone,
        {"forces_n": [0.1], "samples": 64.0},
        {"field": "samples", "value": 64.0, "allowed": "a whole number"},
    ),
    (constant_force_response, {"force_n": 0.0}, {"field": "force_n", "value": 0.0, "allowed": "above 0"}),
    (
        constant_force_response,
        {"force_n": 1.0, "phase_lags_deg": [-20.0, -90.0]},
        {"says": "not-rising", "field": "phase_lags_deg"},
    ),
    (
        forced_response,
        {"voltage_v": 0.0, "frequencies_hz": [10.0]},
        {"field": "voltage_v", "value": 0.0, "allowed": "above 0"},
    ),
    (
        forced_response,
        {"voltage_v": 1.0, "frequencies_hz": [10.0, -1.0]},
        {"field": "frequencies_hz", "value": -1.0, "allowed": "above 0"},
    ),
]


@pytest.mark.parametrize(("analysis", "arguments", "message"), BAD)
def test_bad_values_are_named(analysis: Callable[..., Any], arguments: dict[str, Any], message: str) -> None:
    with refused(ValueError, **message):
        analysis(one_mode(), **arguments)


@pytest.mark.slow
def test_a_level_out_of_reach_is_named_and_the_points_before_it_are_kept() -> None:
    softening = one_mode(elements=[{"kind": "cubic", "at": "drive", "stiffness_n_m3": -3e8}])
    with refused(NotConvergedError, "force-n-lag-deg") as caught:
        phase_resonance_backbone(softening, forces_n=[0.1, 0.5, 1000.0])
    assert caught.value.found is not None
    np.testing.assert_allclose(caught.value.found.force_n, [0.1, 0.5], rtol=1e-8)
    with pytest.raises(NotConvergedError) as nothing:
        phase_resonance_backbone(softening, forces_n=[1000.0])
    assert nothing.value.found is None


def test_what_a_run_would_flag_is_flagged() -> None:
    narrow = {"dac_range_v": 1.0, "adc_range_v": 20.0}
    found = phase_resonance_backbone(ideal(converter=narrow), forces_n=[0.1, 0.4, 3.0])
    assert found.voltage_v[1] > 1.0 > found.voltage_v[0]
    drive = np.abs(found.sensor_harmonics["drive"])
    assert np.max(drive[1]) > 20.0 > drive[0].sum()
    assert Flag(int(found.flags[0])) == Flag(0)
    assert Flag(int(found.flags[1])) == Flag.DAC_CLIPPED | Flag.SENSOR_CLIPPED
    assert Flag.LAW_RANGE in Flag(int(found.flags[2]))
    assert np.abs(found.point_harmonics_m["magnet"][2]).sum() > 0.7 * 0.011


def test_a_mode_is_chosen_by_its_frequency() -> None:
    rig = ideal()
    assert phase_resonance_backbone(rig, forces_n=[0.01]).frequency_hz[0] == pytest.approx(24.37, abs=0.01)
    second = phase_resonance_backbone(rig, forces_n=[0.01], near_hz=130.0)
    assert second.frequency_hz[0] == pytest.approx(134.06, abs=0.1)
    assert second.damping_ratio[0] == pytest.approx(0.0007, rel=0.02)


def test_points_and_harmonics_that_do_not_exist_are_named() -> None:
    rig = ideal()
    found = phase_resonance_backbone(rig, forces_n=[0.1], harmonics=3)
    with refused(ValueError, field="harmonic", value=4, allowed="0 to 3"):
        found.force_harmonic_ratio(4)
    with refused(ValueError, field="point", value=1, allowed="-1 to 0"):
        hysteresis_loops(rig, found, 1)


FREE = ideal(
    structure={"boundary": "free-free", "damping_ratio": [0.0, 0.0, 0.002], "lumped_masses": []},
    friction=[],
    elements=[{"kind": "cubic", "at": "tip", "stiffness_n_m3": 1e6}],
)


def test_a_free_motion_that_a_site_pushes_is_refused_and_one_that_none_pushes_is_not() -> None:
    with refused(ValueError, "structure-has-a-motion-that-no"):
        phase_resonance_backbone(FREE, forces_n=[0.1])
    linear = FREE.model_copy(update={"elements": ()})
    found = phase_resonance_backbone(VirtualRig.model_validate(linear.model_dump()), forces_n=[0.1])
    assert found.damping_ratio[0] == pytest.approx(0.002, rel=1e-4)  # the free motions move along


def test_the_mode_nearest_to_a_frequency_is_no_free_motion() -> None:
    modes = FREE.linear_modes
    assert modes.frequency_hz[1] < 1e-3
    assert modes.nearest(1.0) == 2


def test_the_level_that_was_asked_for_is_named_where_the_path_ends_before_it() -> None:
    softening = one_mode(elements=[{"kind": "cubic", "at": "drive", "stiffness_n_m3": -3e8}])
    with refused(NotConvergedError, "force-n-lag-deg-no-periodic"):
        phase_resonance_backbone(softening, forces_n=[1000.0])


def test_a_force_that_is_no_number_ends_the_path_without_a_warning() -> None:
    broken = one_mode(elements=[{"kind": "user", "at": "drive", "function": nan_beyond_ten_micrometres}])
    with pytest.raises(NotConvergedError):
        phase_resonance_backbone(broken, forces_n=[1.0])
