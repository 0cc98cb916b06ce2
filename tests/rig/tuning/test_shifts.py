"""Windows and ramps that leave room for hardening and softening."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rig.bench import load_bench
from rig.tuning.shifts import START_SHARES, frequency_window, largest_start_force, other_modes, ramp_periods, start_of
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


def with_force_limit(force_n):
    bench = load_bench("magnet-beam")
    return bench.model_copy(update={"limits": bench.limits.model_copy(update={"force_n": force_n})})


def test_the_rig_is_set_in_motion_by_the_voltage_of_the_lowest_level_where_the_force_allows_it():
    plant, bench = plant_of("magnet-beam"), load_bench("magnet-beam")
    assert start_of(bench, plant, 0.1) == (0.1, 10.0)
    assert start_of(with_force_limit(0.01), plant, 0.1).voltage_v < 0.05


@pytest.mark.parametrize("shape", [0.5, 1.0, 4.0])
@pytest.mark.parametrize("ramp", [10.0, 100.0])
def test_the_force_of_a_start_is_that_of_the_whole_signal(shape, ramp):
    """The force over a ramp of the voltage near resonance, sample by sample, by the Fourier transform of the signal."""
    plant = dataclasses.replace(plant_of("magnet-beam"), residual_per_kg=(0.0, 0.0))
    plant = dataclasses.replace(plant, drive_shape=shape * plant.drive_shape)
    omega = plant.lock_frequency_rad_s()
    n, period = 1 << 16, 2.0 * np.pi / omega
    times = np.arange(n) * period / 32.0
    rate = 2.0 * np.pi * np.fft.rfftfreq(n, period / 32.0)
    inside = (rate > 0.5 * omega) & (rate < 1.5 * omega)
    response = np.zeros(rate.size, complex)
    response[inside] = plant.force_per_v(1j * rate[inside])
    rise = 0.5 * (1.0 - np.cos(np.pi * np.minimum(times / (ramp * period), 1.0)))
    rise[n // 2 :] *= np.linspace(1.0, 0.0, n - n // 2)
    largest = max(
        np.max(np.abs(np.fft.irfft(np.fft.rfft(rise * np.sin(off * omega * times)) * response, n))[: n // 2])
        for off in np.linspace(0.97, 1.03, 13)
    )
    assert largest_start_force(plant, ramp) == pytest.approx(largest, rel=0.03)


def test_where_the_force_of_a_start_could_not_be_read_its_ramp_is_longer():
    """A force sensor whose two bits are more than the force of a short ramp within the limit, beside a longer one's."""
    plant = dataclasses.replace(plant_of("magnet-beam"), drive_shape=4.0 * plant_of("magnet-beam").drive_shape)
    bench = with_force_limit(0.1)
    assert start_of(with_force_limit(10.0), plant, 1.0) == (1.0, 10.0)
    force = bench.channels[bench.index_of("force")]
    quick, slow = (START_SHARES[0] * 0.1 / largest_start_force(plant, ramp) for ramp in (10.0, 300.0))
    assert slow > 1.05 * quick
    wanted_n = 0.5 * (quick + slow) / plant.volts_per_newton()
    coarse = force.model_copy(update={"resolution_v": 0.5 * wanted_n * force.resolution_v / force.resolution_in_unit})
    channels = tuple(coarse if one.name == force.name else one for one in bench.channels)
    start = start_of(bench.model_copy(update={"channels": channels}), plant, 1.0)
    assert start.ramp_periods > 10.0
    assert 0.5 * (quick + slow) <= start.voltage_v <= slow
    unreadable = coarse.model_copy(update={"resolution_v": 2.0 * coarse.resolution_v})
    channels = tuple(unreadable if one.name == force.name else one for one in bench.channels)
    start = start_of(bench.model_copy(update={"channels": channels}), plant, 1.0)
    assert slow < start.voltage_v <= 2.0 * slow  # half of the limit in place of a quarter
