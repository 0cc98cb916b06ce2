"""Windows and ramps that leave room for hardening and softening."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rig.bench import load_bench
from rig.tuning.shifts import frequency_window, other_modes, ramp_periods, start_voltage
from tests.controller.tuning.rigs import plant_of

HERTZ = 24.37


def responses_with(*others_hz):
    """Force of one newton per volt; accelerance of the tested mode and of others."""
    frequency = np.arange(0.4 * HERTZ, 2.5 * HERTZ, 0.02)
    accelerance = sum(
        frequency**2 / (frequency**2 - hertz**2 - 0.01j * hertz * frequency) for hertz in (HERTZ, *others_hz)
    )
    return SimpleNamespace(
        frequency_hz=frequency, value=np.stack([np.ones_like(accelerance), accelerance], axis=1)[:, :, None]
    )


def test_a_window_has_room_for_hardening_where_no_other_mode_is_near():
    window = frequency_window(load_bench("magnet-beam"), responses_with(), plant_of("magnet-beam"))
    assert window.lowest_hz == pytest.approx(0.8 * HERTZ, rel=1e-3)
    assert window.highest_hz == pytest.approx(1.25 * HERTZ, rel=1e-3)


def test_a_window_ends_half_way_to_another_mode():
    window = frequency_window(load_bench("magnet-beam"), responses_with(30.0), plant_of("magnet-beam"))
    assert window.highest_hz == pytest.approx(math.sqrt(HERTZ * 30.0), rel=0.01)
    assert window.lowest_hz == pytest.approx(0.8 * HERTZ, rel=1e-3)
    assert "another mode at 30" in window.why


@pytest.mark.parametrize("others", [(), (19.0,), (33.0,), (18.0, 31.0)])
def test_other_modes_are_found_on_either_side(others):
    below, above = other_modes(responses_with(*others), plant_of("magnet-beam"))
    for found, expected in ((below, [hz for hz in others if hz < HERTZ]), (above, [hz for hz in others if hz > HERTZ])):
        if expected:
            assert found == pytest.approx(expected[0], rel=0.01)
        else:
            assert found is None or abs(math.log(found / HERTZ)) > 0.5  # the end of the band, too far to matter


def test_a_window_keeps_the_bench_s_limits():
    bench = load_bench("magnet-beam")
    limits = bench.limits.model_copy(update={"frequency_hz": (22.0, 600.0)})
    window = frequency_window(bench.model_copy(update={"limits": limits}), responses_with(), plant_of("magnet-beam"))
    assert window.lowest_hz == 22.0


def test_ramps_are_longer_with_little_damping_and_with_slow_loops():
    plant = plant_of("magnet-beam")
    usual = ramp_periods(plant, 6.0)
    assert ramp_periods(plant.at(damping_ratio=0.5 * plant.damping_ratio), 6.0) > 1.5 * usual
    assert ramp_periods(plant, 60.0) > usual
    assert 20.0 <= usual <= 300.0


def test_the_rig_is_set_in_motion_by_a_voltage_whose_force_at_rest_is_half_of_the_limit_at_most():
    plant, bench = plant_of("magnet-beam"), load_bench("magnet-beam")
    assert start_voltage(bench, plant, 0.1) == 0.1
    small = bench.model_copy(update={"limits": bench.limits.model_copy(update={"force_n": 0.01})})
    omega = plant.lock_frequency_rad_s()
    blocked = dataclasses.replace(plant, drive_shape=1e-6 * plant.drive_shape, residual_per_kg=(0.0, 0.0))
    assert abs(blocked.force_per_v(1j * omega)) * start_voltage(small, plant, 0.1) == pytest.approx(0.005, rel=1e-3)
