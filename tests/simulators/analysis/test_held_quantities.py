"""What can be held: the force by its RMS, the displacement; and what is told of stability and slopes, against the time
domain, against each other, and by differences."""

import numpy as np
import pytest

from simulators.analysis import (
    constant_displacement_response,
    constant_force_response,
    forced_response,
    phase_resonance_backbone,
)
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.reference.parameters import ONE_SIDED
from tests.reference.time_integration import TimeDomain
from tests.refused import refused
from tests.simulators.analysis.rigs import one_mode
from tests.simulators.references import ideal
from vibrolock.errors import InputError

LAGS_DEG = np.array([-150.0, -120.0, -90.0, -60.0, -30.0])
MAGNET, FRICTION = "magnet-beam", "friction-beam"


def test_the_rms_held_is_that_of_the_force_in_the_time_domain() -> None:
    found = constant_force_response(ideal(friction=[]), 0.3, [-90.0, -60.0], quantity="rms")
    np.testing.assert_allclose(found.force_rms_n, 0.3, rtol=1e-9)
    assert np.all(found.force_harmonic_ratio(2) > 0.9), "the harmonics matter"
    run = TimeDomain(ONE_SIDED.without_friction(), float(found.voltage_v[1]), 2 * np.pi * float(found.frequency_hz[1]))
    force = run.force_n(run.without_friction(60))
    assert np.std(force) == pytest.approx(0.3, rel=1e-3)
    assert abs(run.harmonics(force)[1]) == pytest.approx(found.force_n[1], rel=1e-3)


def test_without_harmonics_the_rms_is_the_peak_over_root_two() -> None:
    rig = VirtualRig.shipped(FRICTION)
    by_rms = constant_force_response(rig, 2.0 / np.sqrt(2.0), LAGS_DEG, quantity="rms", harmonics=1)
    by_peak = constant_force_response(rig, 2.0, LAGS_DEG, harmonics=1)
    np.testing.assert_allclose(by_rms.force_n, 2.0, rtol=1e-8)
    np.testing.assert_allclose(by_rms.frequency_hz, by_peak.frequency_hz, rtol=1e-8)


def test_holding_the_rms_takes_the_unstable_branch_of_a_quarter_newton_away() -> None:
    rig = VirtualRig.shipped(MAGNET)
    lags = np.arange(-150.0, -29.0, 5.0)
    by_peak, by_rms = (
        constant_force_response(rig, f, lags, quantity=q)
        for f, q in ((0.25, "fundamental"), (0.25 / np.sqrt(2), "rms"))
    )
    for found in (by_peak, by_rms):
        falls = np.gradient(found.frequency_hz, lags) < 0.0
        inside = falls[2:] == falls[:-2]  # away from the folds, where the differences tell
        np.testing.assert_array_equal(found.stable[1:-1][inside], ~falls[1:-1][inside])
    assert np.count_nonzero(~by_peak.stable) >= 5
    assert np.all(by_rms.stable)


@pytest.mark.parametrize("specimen", [MAGNET, FRICTION])
def test_what_holds_one_quantity_meets_the_others(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen)
    lags_deg = LAGS_DEG[::2]
    truth = constant_force_response(rig, {MAGNET: 0.55, FRICTION: 5.0}[specimen], lags_deg)
    for k, lag in enumerate(lags_deg):
        amplitude, frequency = truth.amplitude_m[k], truth.frequency_hz[k]
        for found in (
            constant_displacement_response(rig, amplitude, [lag]),
            constant_displacement_response(rig, amplitude, frequencies_hz=[frequency]),
            phase_resonance_backbone(rig, amplitudes_m=[amplitude], phase_lag_deg=lag),
            phase_resonance_backbone(rig, forces_n=[truth.force_rms_n[k]], quantity="rms", phase_lag_deg=lag),
        ):
            assert found.amplitude_m[0] == pytest.approx(amplitude, rel=1e-7)
            assert found.frequency_hz[0] == pytest.approx(frequency, rel=1e-7)
            assert found.force_n[0] == pytest.approx(truth.force_n[k], rel=1e-5)
            assert found.voltage_v[0] == pytest.approx(truth.voltage_v[k], rel=1e-5)


def test_a_held_displacement_is_where_the_time_domain_settles() -> None:
    rig = ideal(FRICTION, converter={"sample_rate_hz": 20000.0, "substeps": 2})
    found = constant_displacement_response(rig, 1.3e-4, [-120.0])
    rate, at_hz = rig.converter.sample_rate_hz, float(found.frequency_hz[0])
    theta = 2 * np.pi * at_hz / rate * np.arange(round(4.0 * rate))
    rise = np.minimum(theta / (200 * np.pi), 1.0)
    run = Simulation(rig).run(found.voltage_v[0] / np.sinc(at_hz / rate) * rise * np.cos(theta))
    last = theta > theta[-1] - 80 * np.pi
    fit = np.exp(-1j * theta[last]) @ np.column_stack([run.force_n, run.displacement_m["drive"]])[last]
    force, drive = 2 * fit / np.count_nonzero(last)
    assert abs(drive) == pytest.approx(1.3e-4, rel=2e-3)
    assert np.degrees(np.angle(-force / drive)) == pytest.approx(-120.0, abs=0.5)


def test_under_constant_voltage_the_unstable_are_those_between_the_folds() -> None:
    rig = one_mode(elements=[{"kind": "cubic", "at": "drive", "stiffness_n_m3": 3e9}])
    lags = np.arange(-170.0, -9.0, 5.0)
    points = [phase_resonance_backbone(rig, voltages_v=[7.0], phase_lag_deg=lag, harmonics=3) for lag in lags]
    frequency = np.array([one.frequency_hz[0] for one in points])
    stable = np.array([one.stable_under_voltage[0] for one in points])
    assert 3 < np.count_nonzero(~stable) < 30
    rises = np.gradient(frequency, lags) > 0.0
    assert np.count_nonzero(stable != rises) <= 2  # at the folds differences cannot tell
    held = [one.stable[0] for one in points]
    np.testing.assert_array_equal(held, stable)


def test_shipped_rigs_are_stable_at_constant_voltage_and_response() -> None:
    for specimen, force in ((MAGNET, 0.55), (FRICTION, 15.0)):
        rig = VirtualRig.shipped(specimen)
        found = constant_force_response(rig, force, LAGS_DEG)
        assert np.all(found.stable_under_voltage)
        assert np.all(constant_displacement_response(rig, float(found.amplitude_m[2]), LAGS_DEG).stable)
    assert np.all(forced_response(VirtualRig.shipped(MAGNET), 3.0, [24.0, 25.0, 26.0]).stable)


def test_the_slope_that_a_force_loop_sees_is_that_between_neighbouring_voltages() -> None:
    rig = VirtualRig.shipped(FRICTION)
    found = phase_resonance_backbone(rig, forces_n=[5.0], phase_lag_deg=-140.0)
    voltage = float(found.voltage_v[0])
    near = phase_resonance_backbone(rig, voltages_v=voltage * np.exp([-1e-4, 1e-4]), phase_lag_deg=-140.0)
    slope = np.diff(np.log(near.force_n))[0] / 2e-4
    assert slope > 5.0, "a loop tuned for one has this much more gain"
    assert found.level_slope[0] == pytest.approx(slope, rel=0.02)


def test_where_less_voltage_means_more_force_the_slope_is_negative() -> None:
    found = phase_resonance_backbone(VirtualRig.shipped(FRICTION), forces_n=[10.0, 12.0, 15.0], phase_lag_deg=-150.0)
    assert found.level_slope[1] < 0.0 < min(found.level_slope[0], found.level_slope[2])


def test_what_cannot_be_held_is_named() -> None:
    rig = one_mode()
    with refused(InputError, field="quantity", value="peak"):
        constant_force_response(rig, 0.1, quantity="peak")
    with refused(InputError, field="phase_lags_deg, frequencies_hz", allowed="one of them"):
        constant_displacement_response(rig, 1e-4, [-90.0], frequencies_hz=[40.0])
    with refused(InputError, field="amplitude_m", value=0.0, allowed="above 0"):
        constant_displacement_response(rig, 0.0)
    with refused(InputError, field="forces_n, voltages_v, amplitudes_m", allowed="one of them"):
        phase_resonance_backbone(rig, forces_n=[0.1], amplitudes_m=[1e-4])
