import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import (
    Backbone,
    Channel,
    IdentificationError,
    ModeShapes,
    NonlinearMode,
    PeriodicVibration,
    nonlinear_mode,
    periodic_vibration,
)
from identification.storage import decode, encode
from tests.identification.rigs import CHANNELS, PHI, one_mode_point, sampled
from tests.refused import refused

LAGS_DEG = (35.0, 80.0, 90.0, 93.0, 140.0)


def test_a_linear_rig_returns_its_own_frequency_and_damping_at_any_phase() -> None:
    backbone = Backbone(tuple(one_mode_point(lag) for lag in LAGS_DEG), "beam", PHI)
    mode = nonlinear_mode(backbone)
    np.testing.assert_allclose(mode.modal_frequency_hz, 24.37, rtol=1e-12)
    np.testing.assert_allclose(mode.damping_ratio, 0.004, rtol=1e-12)
    np.testing.assert_allclose(mode.damping_ratio_total_power, 0.004, rtol=1e-12)
    np.testing.assert_allclose(mode.modal_amplitude, backbone.amplitude_m / PHI, rtol=1e-12)
    np.testing.assert_allclose(mode.apparent_mass_kg, 1 / PHI**2, rtol=1e-12)
    np.testing.assert_allclose(mode.force_purity, 1.0)
    assert mode.damping_ratio_uncorrected[2] == pytest.approx(0.004, rel=1e-9)
    assert abs(mode.damping_ratio_uncorrected[0] / 0.004 - 1) > 1e-3, "the correction matters away from resonance"


def test_a_sampled_linear_rig_returns_its_own_damping() -> None:
    point = one_mode_point(97.0)
    theta = np.arange(10_000) / 5000.0 * 2 * np.pi * point.frequency_hz
    measured = periodic_vibration(theta, sampled(point.harmonics, theta), CHANNELS, sample_rate_hz=5000.0)
    mode = nonlinear_mode(Backbone((measured,), drive_mode_shape=-PHI))
    assert mode.damping_ratio[0] == pytest.approx(0.004, rel=1e-9)
    assert mode.modal_frequency_hz[0] == pytest.approx(24.37, rel=1e-9)


def test_total_power_counts_what_the_force_harmonics_dissipate() -> None:
    point = one_mode_point(forces=(0.0, 0.3, 0.54, -0.2j))
    mode = nonlinear_mode(Backbone((point,), drive_mode_shape=PHI))
    share = np.abs(point.drive_m[1:]) * np.arange(1, 4)
    assert mode.damping_ratio[0] == pytest.approx(0.004, rel=1e-12)
    expected = 0.004 * np.sum(share**2) / share[0] ** 2
    assert mode.damping_ratio_total_power[0] == pytest.approx(expected, rel=1e-12)
    assert mode.force_harmonic_ratio(2)[0] == pytest.approx(1.8)
    assert mode.force_purity[0] == pytest.approx(0.3 / np.sqrt(0.3**2 + 0.54**2 + 0.2**2))
    assert np.isnan(mode.force_harmonic_ratio(4)[0])


def test_total_power_of_an_integrated_duffing_oscillator_is_what_its_damper_dissipates() -> None:
    zeta, omega, cubic = 0.05, 1.25, 0.8

    def rate(t: float, state: np.ndarray) -> list[float]:
        force = 0.15 * np.cos(omega * t) + 0.2 * np.cos(3 * omega * t + 1.0)
        return [state[1], force - 2 * zeta * state[1] - state[0] - cubic * state[0] ** 3]

    period = 2 * np.pi / omega
    times = period * (60 + np.arange(1280) / 256)
    path = solve_ivp(rate, (0, times[-1]), [0, 0], "DOP853", times, rtol=1e-11, atol=1e-13).y
    theta = omega * times
    force = 0.15 * np.cos(theta) + 0.2 * np.cos(3 * theta + 1.0)
    channels = (CHANNELS[0], Channel("drive", "drive", "m"))
    point = periodic_vibration(theta, np.array([force, path[0]]), channels, sample_rate_hz=256 / period, harmonics=20)
    mode = nonlinear_mode(Backbone((point,), drive_mode_shape=1.0))
    omega_modal = 2 * np.pi * mode.modal_frequency_hz[0]
    power = mode.damping_ratio_total_power[0] * omega**2 * omega_modal * mode.modal_amplitude[0] ** 2
    assert power == pytest.approx(2 * zeta * np.mean(path[1] ** 2), rel=1e-5)


def two_sensor_point(tip_ratio: complex) -> PeriodicVibration:
    point = one_mode_point()
    channels = (*point.channels, Channel("tip", "response", "m/s2"))
    harmonics = np.vstack([point.harmonics, tip_ratio * point.harmonics[1]])
    return PeriodicVibration(channels, point.frequency_hz, harmonics, 50, np.zeros(3))


def test_mass_normalised_shapes_give_the_same_modal_amplitude_as_the_drive_point() -> None:
    shapes = ModeShapes(("drive", "tip"), np.array([[PHI], [3.1]]))
    mode = nonlinear_mode(Backbone((two_sensor_point(3.1 / PHI),)), mode_shapes=shapes)
    assert mode.damping_ratio[0] == pytest.approx(0.004, rel=1e-12)
    assert mode.modal_amplitude[0] == pytest.approx(one_mode_point().amplitude_m / PHI, rel=1e-12)
    assert mode.mac[0] == pytest.approx(1.0, rel=1e-12)
    assert all("only: the intervals" in note for note in mode.notes)


def test_modal_amplitude_sums_the_squares_of_the_modes_in_the_shape() -> None:
    basis = np.array([[PHI, -0.4], [3.1, 2.0]])
    modal = np.array([1e-3, 2e-4j])
    displacement = basis @ modal
    channels = (CHANNELS[0], Channel("drive", "drive", "m"), Channel("tip", "response", "m"))
    harmonics = np.column_stack([np.zeros(3), np.r_[0.3j, displacement]])
    point = PeriodicVibration(channels, 20.0, harmonics, 10, np.zeros(3))
    amplitude, error = ModeShapes(("drive", "tip"), basis).modal_amplitude(point)
    assert amplitude == pytest.approx(np.linalg.norm(modal), rel=1e-12)
    assert np.isnan(error)


def test_mac_against_a_linear_shape_of_any_scale() -> None:
    backbone = Backbone((two_sensor_point(2.0),), drive_mode_shape=PHI)
    mode = nonlinear_mode(backbone, linear_shape={"drive": -5.0, "tip": -5.0})
    assert mode.mac[0] == pytest.approx((1 + 2) ** 2 / (2 * (1 + 4)), rel=1e-12)


def test_scaling_the_shape_by_ten_percent_moves_the_damping_as_documented() -> None:
    for factor, change in ((1.1, 0.21), (0.9, -0.19)):
        mode = nonlinear_mode(Backbone((one_mode_point(),), drive_mode_shape=PHI * factor))
        assert mode.damping_ratio[0] / 0.004 - 1 == pytest.approx(change, abs=1e-3)


def test_without_a_mode_shape_frequency_remains_and_a_note_says_what_is_missing() -> None:
    mode = nonlinear_mode(Backbone((one_mode_point(),)))
    assert mode.modal_frequency_hz[0] == mode.frequency_hz[0]
    assert np.isnan(mode.damping_ratio[0])
    assert "drive_mode_shape" in mode.notes[0]
    assert mode.table()[0]["damping_ratio"] is None


def test_stated_uncertainty_covers_the_truth() -> None:
    point = one_mode_point(84.0)
    theta = np.arange(5000) / 5000.0 * 2 * np.pi * point.frequency_hz
    clean = sampled(point.harmonics, theta)
    scale = np.abs(point.harmonics[:, 1])[:, None] * np.array([[0.05], [0.02]])
    deviations = []
    for seed in range(200):
        noise = scale * np.random.default_rng(seed).normal(size=clean.shape)
        measured = periodic_vibration(theta, clean + noise, CHANNELS, sample_rate_hz=5000.0, harmonics=2)
        mode = nonlinear_mode(Backbone((measured,), drive_mode_shape=PHI))
        deviations.append(
            [
                (mode.modal_frequency_hz[0] - 24.37) / mode.modal_frequency_std_hz[0],
                (mode.damping_ratio[0] - 0.004) / mode.damping_ratio_std[0],
            ]
        )
    covered = np.mean(np.abs(deviations) < 1.96, axis=0)
    assert np.all((covered > 0.90) & (covered < 0.99)), covered


def test_frequency_shift_compares_largest_with_smallest_amplitude() -> None:
    points = [one_mode_point(f0_hz=f, forces=(0, force)) for f, force in ((24.0, 0.1), (24.9, 0.5), (24.5, 0.3))]
    mode = nonlinear_mode(Backbone(tuple(points), drive_mode_shape=PHI))
    assert mode.frequency_shift == pytest.approx(24.9 / 24.0 - 1, rel=1e-12)


def test_unsettled_and_dead_points_are_refused_by_name() -> None:
    good = one_mode_point()
    with refused(IdentificationError, "is-not-settled", where="points[1] (0.3 N, 24.37 Hz)"):
        nonlinear_mode(Backbone((good, replace(good, settled=False)), drive_mode_shape=PHI))
    dead = replace(good, harmonics=good.harmonics * [[0.0], [1.0]])
    with refused(IdentificationError, "force-or-drive-point-motion-is", where="points[0] (0 N, 24.37 Hz)"):
        nonlinear_mode(Backbone((dead,), drive_mode_shape=PHI))
    with refused(IdentificationError, "no-channel-tip-channels-force-drive"):
        nonlinear_mode(Backbone((good,)), mode_shapes=ModeShapes(("drive", "tip"), np.ones((2, 1))))


@pytest.mark.parametrize("signs", [[[1], [-1]], [[-1], [1]]])
def test_a_reversed_force_or_drive_is_refused_and_polarity_named(signs: list[list[int]]) -> None:
    points = [one_mode_point(forces=(0, force)) for force in (0.1, 0.2, 0.3)]
    flipped = [replace(point, harmonics=point.harmonics * signs) for point in points]
    with refused(IdentificationError, "damping-ratio-of-of-is-negative", field="points"):
        nonlinear_mode(Backbone(tuple(flipped), drive_mode_shape=PHI))
    mode = nonlinear_mode(Backbone((points[0], points[1], flipped[2]), drive_mode_shape=PHI))
    assert np.sign(mode.damping_ratio).tolist() == [1.0, 1.0, -1.0]
    assert any("polarity" in note for note in mode.notes)


def test_a_mode_survives_being_stored_and_its_table_is_json() -> None:
    shapes = ModeShapes(("drive", "tip"), np.array([[PHI], [3.1]]))
    mode = nonlinear_mode(Backbone((two_sensor_point(1.5),), "beam"), mode_shapes=shapes)
    arrays, attributes = encode(mode)
    again = decode(NonlinearMode, arrays, json.loads(json.dumps(attributes)))
    for name, array in arrays.items():
        np.testing.assert_array_equal(getattr(again, name), array)
    assert (again.source, again.specimen, again.notes) == ("backbone", "beam", mode.notes)
    row = json.loads(json.dumps(mode.table(), allow_nan=False))[0]
    assert {"force_n", "modal_frequency_hz", "damping_ratio", "modal_amplitude", "mac", "amplitude_m"} <= set(row)
    with refused(IdentificationError, "force-n-is-missing", where="nonlinear mode"):
        decode(NonlinearMode, {k: v for k, v in arrays.items() if k != "force_n"}, attributes)


def test_mode_shapes_that_channels_cannot_tell_apart_are_refused() -> None:
    with refused(IdentificationError, "modes-are-not-told-apart-by", field="shapes"):
        ModeShapes(("drive",), np.array([[1.0, 2.0]]))
    with refused(IdentificationError, field="mode", value=1, allowed="0 to 0"):
        ModeShapes(("drive",), np.array([[1.0]]), mode=1)
