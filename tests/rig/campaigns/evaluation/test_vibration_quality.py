"""Purity, power and the warnings about a vibration, against vibrations made by hand and the identification."""

import math
from dataclasses import asdict

import numpy as np
import pytest

from identification import Backbone, Channel, PeriodicVibration, nonlinear_mode
from rig.campaigns.evaluation.vibration_quality import damping_bias, lag_scatter_deg, purity, quality_warnings
from rig.tick.layout import ROW
from tests.rig.rigs import bench_with

BENCH = bench_with()
CHANNELS = tuple(Channel(c.name, c.role, c.unit) for c in BENCH.channels)
OMEGA = 2 * math.pi * 24.37


def vibration(force, motion_m, frequency_hz=24.37):
    """From harmonics 1 to H of force (N) and displacement (m)."""
    orders = np.arange(1, len(force) + 1)
    harmonics = np.zeros((4, len(force) + 1), complex)
    harmonics[0, 1:] = force
    harmonics[1, 1:] = -((2 * math.pi * frequency_hz * orders) ** 2) * np.asarray(motion_m)
    return PeriodicVibration(CHANNELS, frequency_hz, harmonics, 20, np.zeros(4))


def rows_with(error_deg):
    rows = np.zeros(len(error_deg), ROW)
    rows["phase_error_rad"] = np.radians(error_deg)
    return rows


def test_a_pure_vibration_at_phase_resonance_has_purity_and_power_indicator_one():
    found = purity(vibration([1.0, 0.0], [-1e-3j, 0.0]))
    assert asdict(found) == pytest.approx(
        {"force_purity": 1.0, "response_purity": 1.0, "power_indicator": 1.0, "harmonic_power": 0.0}
    )


@pytest.mark.parametrize("off_deg", [0.0, 10.0, 60.0])
def test_off_phase_resonance_the_power_indicator_is_the_cosine_of_the_angle(off_deg):
    found = purity(vibration([np.exp(1j * math.radians(off_deg))], [-1e-3j]))
    assert found.power_indicator == pytest.approx(math.cos(math.radians(off_deg)))


def test_powers_are_those_of_the_signals_in_time():
    force, motion = np.array([1.0, 0.5 - 0.3j, 0.2j]), np.array([-1e-3j, 2e-5 + 1e-5j, -4e-6])
    theta = 2 * math.pi * np.arange(4096) / 4096
    orders = np.arange(1, 4)
    waves = np.exp(1j * np.outer(orders, theta))
    f, v = (force @ waves).real, ((1j * OMEGA * orders * motion) @ waves).real
    found = purity(vibration(force, motion))
    assert found.power_indicator == pytest.approx(np.mean(f * v) / (f.std() * v.std()))
    first = np.mean((force[0] * waves[0]).real * (1j * OMEGA * motion[0] * waves[0]).real)
    assert found.harmonic_power == pytest.approx(np.mean(f * v) / first - 1.0)
    assert found.force_purity == pytest.approx(1.0 / math.sqrt(1.0 + 0.34 + 0.04))


def test_they_are_those_of_the_identified_mode_and_tell_how_far_its_dampings_differ():
    measured = vibration([1.0 - 0.1j, 0.5 - 0.3j, 0.2j], [-1e-3j, 2e-5 + 1e-5j, -4e-6])
    mode = nonlinear_mode(Backbone((measured,), "", 0.9))
    found = purity(measured)
    assert found.force_purity == pytest.approx(mode.force_purity[0])
    assert found.response_purity == pytest.approx(mode.response_purity[0])
    ratio = mode.damping_ratio_total_power[0] / mode.damping_ratio[0]
    assert found.harmonic_power == pytest.approx(ratio - 1.0)


@pytest.mark.parametrize(("share", "warned"), [(0.009, False), (0.011, True), (-0.011, True)])
def test_harmonics_that_carry_more_than_a_percent_of_the_power_are_remarked_on(share, warned):
    # second harmonic: P_2 = Re(F_2 conj(2 i Omega X_2))/2 against P_1 = Omega 1e-3 / 2
    second = -1e-5j
    measured = vibration([1.0, share * 1e-3 / 2e-5], [-1e-3j, second])
    remarks = damping_bias(measured)
    assert purity(measured).harmonic_power == pytest.approx(share)
    assert bool(remarks) is warned
    if warned:
        side = "higher" if share > 0 else "lower"
        assert remarks[0].startswith("force harmonics (damping ±1.1 %): ")
        assert f"1.1 % {side} than from the fundamental" in remarks[0]


def test_a_lag_that_scatters_by_more_than_five_degrees_is_warned_of_under_a_lock_only():
    measured = vibration([1.0], [-1e-3j])
    for size, warned in ((4.0, False), (6.0, True)):
        rows = rows_with([size, -size] * 20)
        assert lag_scatter_deg(rows) == pytest.approx(size, rel=1e-5)
        assert any("scatters" in line for line in quality_warnings(BENCH, measured, rows)) is warned
    assert math.isnan(lag_scatter_deg(rows_with([math.nan] * 5)))


def test_a_lock_far_from_the_linear_frequency_is_warned_of_and_a_tone_there_is_not():
    for frequency_hz, warned in ((26.5, False), (27.0, True), (21.5, True)):
        lines = quality_warnings(BENCH, vibration([1.0], [-1e-3j], frequency_hz), rows_with([0.0]))
        assert any("another mode" in line for line in lines) is warned
    assert not quality_warnings(BENCH, vibration([1.0], [-1e-3j], 40.0), rows_with([math.nan]))
