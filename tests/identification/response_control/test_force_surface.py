import numpy as np
import pytest

from identification import (
    ConstantForceCurve,
    FrequencyResponse,
    IdentificationError,
    force_surface,
    single_point_mode,
    stepped_sine_mode,
)
from simulators.analysis import PeriodicResponses, phase_resonance_backbone
from tests.identification.response_control.levels import (
    LAGS_DEG,
    OMEGA,
    SHAPE,
    duffing_level,
    duffing_stiffness,
    measured,
    rig,
    truth,
)
from tests.refused import refused

DUFFING_M = np.geomspace(5e-4, 2.4e-3, 20)
MAGNET_M = tuple(np.geomspace(0.45e-3, 2.2e-3, 8))
FRICTION_M = tuple(np.geomspace(0.055e-3, 0.24e-3, 26))


def off(curve: ConstantForceCurve, true: PeriodicResponses) -> tuple[float, float]:
    """Largest errors of amplitude and of frequency, relative, at the same lags."""
    np.testing.assert_allclose(curve.response.phase_lag_deg, LAGS_DEG, atol=1e-6)
    amplitude = np.max(np.abs(curve.response.amplitude_m / true.amplitude_m - 1.0))
    return float(amplitude), float(np.max(np.abs(curve.response.frequency_hz / true.frequency_hz - 1.0)))


def test_the_curve_of_a_duffing_oscillator_is_its_closed_form_with_its_unstable_branch() -> None:
    curve = force_surface([duffing_level(x) for x in DUFFING_M]).constant_force(0.6)
    omega, a = 2 * np.pi * curve.response.frequency_hz, curve.response.amplitude_m
    np.testing.assert_allclose(np.abs(duffing_stiffness(omega, a)) * a, 0.6, rtol=3e-3)
    assert np.all(np.diff(curve.response.phase_lag_deg) > 0.0)
    # a fold is where (w0^2 + 3/4 k a^2 - W^2)^2 + (2 z w0 W)^2 = (phi^2 F / a)^2 has a vertical tangent
    stiff = np.real(duffing_stiffness(omega, a)) * SHAPE**2
    by_amplitude = stiff * 3.0 * 3e8 * SHAPE**2 * a + 2 * (SHAPE**2 * 0.6) ** 2 / a**3
    clear = np.abs(by_amplitude) > 0.03 * np.max(np.abs(by_amplitude))
    np.testing.assert_array_equal(curve.stable[clear], by_amplitude[clear] > 0.0)
    assert 10 < np.count_nonzero(~curve.stable) < curve.stable.size - 10
    assert not curve.notes


@pytest.mark.parametrize(("force_n", "goal"), [(0.25, 0.002), (0.55, 0.002)])
def test_eight_levels_give_the_magnet_beams_curves(force_n: float, goal: float) -> None:
    curve = force_surface(measured("magnet-beam", MAGNET_M, 5)).constant_force(force_n, LAGS_DEG)
    true = truth("magnet-beam", force_n)
    amplitude, frequency = off(curve, true)
    assert amplitude < goal
    assert frequency < 1.5e-4
    np.testing.assert_array_equal(curve.stable, true.stable)
    assert np.any(~curve.stable)


@pytest.mark.parametrize("force_n", [2.0, 5.0, 15.0])
def test_twenty_six_levels_give_the_friction_beams_curves_within_a_percent(force_n: float) -> None:
    curve = force_surface(measured("friction-beam", FRICTION_M, 5)).constant_force(force_n, LAGS_DEG)
    amplitude, frequency = off(curve, truth("friction-beam", force_n))
    assert amplitude < 0.01
    assert frequency < 2e-4
    assert np.all(curve.stable)
    assert np.max(curve.amplitude_change) > amplitude, "half of the levels bound the error of all"


def test_levels_where_they_are_needed_do_better_than_evenly_spaced_ones() -> None:
    even, slips_m = np.geomspace(3e-4, 2.4e-3, 11), 7.4e-4
    chosen = [duffing_level(level, slips_m=slips_m) for level in even[::2]]
    while len(chosen) < even.size:
        chosen.append(duffing_level(force_surface(chosen).next_level_m(), slips_m=slips_m))
    errors = []
    for levels in (chosen, [duffing_level(level, slips_m=slips_m) for level in even]):
        curve = force_surface(levels).constant_force(0.45, LAGS_DEG).response
        omega, a = 2 * np.pi * curve.frequency_hz, curve.amplitude_m
        errors.append(np.max(np.abs(np.abs(duffing_stiffness(omega, a, slips_m)) * a / 0.45 - 1.0)))
    assert errors[0] < 0.7 * errors[1]


def test_a_level_that_was_missed_by_a_percent_costs_nothing() -> None:
    exact = force_surface([duffing_level(x) for x in DUFFING_M]).constant_force(0.6, LAGS_DEG).response
    levels = [duffing_level(x, missed=0.01, seed=k) for k, x in enumerate(DUFFING_M)]
    missed = force_surface(levels).constant_force(0.6, LAGS_DEG).response
    np.testing.assert_allclose(missed.amplitude_m, exact.amplitude_m, rtol=3e-3)
    np.testing.assert_allclose(missed.frequency_hz, exact.frequency_hz, rtol=1e-4)


@pytest.mark.slow
def test_standard_errors_are_those_of_repeated_tests() -> None:
    runs = []
    for repeat in range(40):
        levels = [duffing_level(x, noise=0.01, seed=100 * repeat + k) for k, x in enumerate(DUFFING_M)]
        runs.append(force_surface(levels).constant_force(0.6, [40.0, 90.0, 140.0]))
    for name, std in (("amplitude_m", "amplitude_std_m"), ("frequency_hz", "frequency_std_hz")):
        scatter = np.std([getattr(run.response, name) for run in runs], axis=0)
        told = np.sqrt(np.mean([getattr(run, std) ** 2 for run in runs], axis=0))
        np.testing.assert_allclose(told / scatter, 1.0, atol=0.4)


def test_a_curve_ends_where_the_levels_end() -> None:
    levels = [duffing_level(x) for x in DUFFING_M[4:16]]
    surface = force_surface(levels)
    resonance = surface.at_lag(90.0).force_n
    with refused(IdentificationError, "levels-at-lag-deg-hold-to", field="force_n", value=5.0):
        surface.constant_force(5.0)
    curve = surface.constant_force(float(resonance[2]))
    assert np.all(curve.response.amplitude_m >= DUFFING_M[4] * (1 - 1e-9))
    assert curve.response.phase_lag_deg.min() > 30.0
    assert "lags left out (30 to 150 deg)" in curve.notes[0]
    above = surface.constant_force(1.02 * float(resonance[-1]))
    assert np.all(above.response.amplitude_m <= DUFFING_M[15] * (1 + 1e-9))
    assert np.min(np.abs(above.response.phase_lag_deg - 90.0)) > 5.0


def test_lags_that_were_not_measured_are_left_out() -> None:
    curve = force_surface([duffing_level(x) for x in DUFFING_M]).constant_force(0.35, np.arange(5.0, 176.0, 5.0))
    assert curve.response.phase_lag_deg.min() > 20.0
    assert curve.response.phase_lag_deg.max() < 160.0
    assert curve.notes


def test_the_section_at_resonance_is_the_nonlinear_mode() -> None:
    surface = force_surface(measured("magnet-beam", MAGNET_M, 5))
    true = phase_resonance_backbone(rig("magnet-beam"), amplitudes_m=MAGNET_M)
    mode = single_point_mode([surface.at_lag()], float(rig("magnet-beam").linear_modes.drive_shape[0]))
    np.testing.assert_allclose(mode.amplitude_m, MAGNET_M, rtol=1e-8)
    np.testing.assert_allclose(mode.modal_frequency_hz, true.modal_frequency_hz, rtol=1e-6)
    np.testing.assert_allclose(mode.damping_ratio, true.damping_ratio, rtol=2e-4)
    fitted = stepped_sine_mode(measured("magnet-beam", MAGNET_M, 5), phase_window_deg=70.0)
    np.testing.assert_allclose(fitted.modal_frequency_hz, true.modal_frequency_hz, rtol=1e-5)


def test_levels_in_any_order_repeated_and_as_accelerations_are_the_same_surface() -> None:
    levels = [duffing_level(x) for x in DUFFING_M]
    expected = force_surface(levels).constant_force(0.4, LAGS_DEG).response
    # a held acceleration is a displacement that falls a little with the frequency
    as_acceleration = [
        FrequencyResponse(
            one.frequency_hz,
            one.force,
            -((2 * np.pi * one.frequency_hz) ** 2) * one.response,
            "acceleration",
            "response",
            one.level * OMEGA**2,
        )
        for one in levels
    ]
    for others in (levels[::-1], [*levels, *levels], as_acceleration):
        found = force_surface(others).constant_force(0.4, LAGS_DEG).response
        np.testing.assert_allclose(found.amplitude_m, expected.amplitude_m, rtol=1e-8)


def test_bad_levels_are_named() -> None:
    level = duffing_level(1e-3)
    held = FrequencyResponse(level.frequency_hz, level.force, level.response, "displacement", "force", 1.0, "1 N")
    with refused(IdentificationError, "held-force-must-hold-the-response", field="responses"):
        force_surface([held])
    with refused(IdentificationError, "levels", field="responses", allowed="at least 3"):
        force_surface([level, duffing_level(2e-3), level])
    few = [duffing_level(x, points=3) for x in DUFFING_M]
    with refused(IdentificationError, "points", where="level 0.5 mm", allowed="at least 4"):
        force_surface(few)
    below = [
        FrequencyResponse(x.frequency_hz[:4], x.force[:4], x.response[:4], "displacement", "response", x.level)
        for x in (duffing_level(x) for x in DUFFING_M)
    ]
    with refused(IdentificationError, "lags-do-not-enclose-measure-on", where="level 0.5 mm"):
        force_surface(below)
    surface = force_surface([duffing_level(x) for x in DUFFING_M])
    with refused(IdentificationError, field="phase_lags_deg", allowed="rising lags between 0 and 180"):
        surface.constant_force(0.5, [-90.0])
    with refused(IdentificationError, field="force_n", allowed="finite and above zero"):
        surface.constant_force(0.0)
    with refused(IdentificationError, "no-level-was-measured-there", field="phase_lag_deg", value=5.0):
        surface.at_lag(5.0)
