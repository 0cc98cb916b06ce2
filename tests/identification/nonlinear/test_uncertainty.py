"""Standard errors by Monte Carlo against first-order propagation, known errors, and the coverage that they promise."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Backbone,
    Channel,
    IdentificationError,
    ModeShapes,
    NonlinearMode,
    PeriodicVibration,
    nonlinear_mode as identify,
)
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS
from identification.storage import decode, encode
from tests.identification.rigs import PHI, one_mode_point
from tests.refused import refused

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
SHAPE = np.array([PHI, 3.1])


def noisy_point(lag_deg: float = 90.0, relative: float = 1e-3, forces: tuple[complex, ...] = (0, 0.3, 0.1)):
    """A one-mode point with a second sensor and stated errors; nothing is added to its harmonics."""
    point = one_mode_point(lag_deg, forces=forces)
    harmonics = np.vstack([point.harmonics, point.harmonics[1] * SHAPE[1] / SHAPE[0]])
    std = relative * np.abs(harmonics[:, 1])[:, None] * np.ones(harmonics.shape)
    return PeriodicVibration(CHANNELS, point.frequency_hz, harmonics, 200, np.zeros(3), std)


def with_errors(point: PeriodicVibration, rng: np.random.Generator) -> PeriodicVibration:
    noise = rng.standard_normal(point.harmonics.shape) + 1j * rng.standard_normal(point.harmonics.shape)
    return replace(point, harmonics=point.harmonics + point.harmonics_std * noise)


@pytest.mark.parametrize("lag_deg", [60.0, 90.0, 110.0])
def test_standard_errors_are_those_of_first_order_propagation(lag_deg: float) -> None:
    relative = 1e-3
    mode = identify(Backbone((noisy_point(lag_deg, relative),), drive_mode_shape=PHI), draws=20_000)
    w, f, z, lag = mode.modal_frequency_hz[0], mode.frequency_hz[0], mode.damping_ratio[0], np.radians(lag_deg)
    tails = np.sqrt(38 / 36)  # Student's, of twenty batches
    size = 2 * z * f * w / np.sin(lag)  # |phi^2 F / Q| / (2 pi)^2
    magnitude = angle = np.sqrt(2) * relative * tails
    frequency_std = size * np.hypot(np.cos(lag) * magnitude, np.sin(lag) * angle) / (2 * w)
    damping_std = size * np.hypot(np.sin(lag) * magnitude, np.cos(lag) * angle) / (2 * w * f)
    assert mode.modal_frequency_std_hz[0] == pytest.approx(frequency_std, rel=0.03)
    assert mode.damping_ratio_std[0] == pytest.approx(damping_std, rel=0.03)
    assert mode.force_std_n[0] == pytest.approx(0.3 * relative * tails, rel=0.03)
    assert mode.modal_amplitude_std[0] == pytest.approx(relative * tails * mode.modal_amplitude[0], rel=0.03)
    assert mode.phase_lag_std_deg[0] == pytest.approx(np.degrees(angle), rel=0.03)


@pytest.mark.parametrize(("periods", "freedom"), [(4, 6), (5, 8), (8, 14), (20, 38), (500, 38)])
def test_standard_errors_of_few_periods_are_those_of_students_distribution(periods: int, freedom: int) -> None:
    """Each coefficient has two parts, and each batch but one is free; the variance of Student's t is ``n / (n - 2)``."""
    point = replace(noisy_point(relative=1e-3), periods=periods)
    mode = identify(Backbone((point,), drive_mode_shape=PHI), draws=20_000)
    assert mode.force_std_n[0] == pytest.approx(0.3e-3 * np.sqrt(freedom / (freedom - 2)), rel=0.03)


def test_one_percent_of_the_shape_is_two_percent_of_the_damping_at_all_points_alike() -> None:
    points = tuple(noisy_point(relative=1e-6, forces=(0, force, 0)) for force in (0.1, 0.2, 0.3))
    shapes = ModeShapes(("drive",), np.array([[PHI]]), shapes_std=np.array([[0.01 * PHI]]))
    mode = identify(Backbone(points), mode_shapes=shapes)
    relative = mode.systematic("damping_ratio") / mode.damping_ratio
    np.testing.assert_allclose(relative, 0.02, rtol=0.1)
    np.testing.assert_allclose(relative, relative[0], rtol=1e-6)
    assert np.all(mode.random("damping_ratio") < 0.02 * mode.systematic("damping_ratio"))
    np.testing.assert_allclose(mode.systematic("force_n"), 0.0)


def test_the_standard_error_of_the_drive_shape_is_twice_in_the_damping_and_in_nothing_measured() -> None:
    points = tuple(noisy_point(relative=1e-6, forces=(0, force, 0)) for force in (0.1, 0.2, 0.3))
    known = identify(Backbone(points, drive_mode_shape=PHI))
    mode = identify(
        Backbone(points, drive_mode_shape=PHI, drive_mode_shape_std=0.01 * PHI, drive_mode_shape_source="x")
    )
    np.testing.assert_array_equal(mode.damping_ratio, known.damping_ratio)
    np.testing.assert_allclose(mode.systematic("damping_ratio") / mode.damping_ratio, 0.02, rtol=0.1)
    np.testing.assert_allclose(mode.systematic("modal_amplitude") / mode.modal_amplitude, 0.01, rtol=0.1)
    np.testing.assert_allclose(mode.systematic("force_n"), 0.0)
    np.testing.assert_allclose(mode.random_std, known.random_std, rtol=0.2)
    read = decode(NonlinearMode, *encode(mode))
    assert (read.drive_mode_shape, read.drive_mode_shape_std) == (PHI, 0.01 * PHI)
    assert read.drive_mode_shape_source == "x"


@pytest.mark.parametrize("std", [0.0, None])
def test_a_drive_shape_without_a_standard_error_changes_no_number(std: float | None) -> None:
    points = tuple(noisy_point(forces=(0, force, 0)) for force in (0.1, 0.2))
    plain = identify(Backbone(points, drive_mode_shape=PHI))
    mode = identify(Backbone(points, drive_mode_shape=PHI, drive_mode_shape_std=std))
    np.testing.assert_array_equal(mode.interval_95, plain.interval_95)
    assert not mode.systematic_std.any()


def test_a_negative_standard_error_of_the_drive_shape_is_refused() -> None:
    with refused(IdentificationError, field="drive_mode_shape_std", value=-0.1, allowed="0 or above"):
        Backbone((noisy_point(),), drive_mode_shape=PHI, drive_mode_shape_std=-0.1)


def test_the_random_part_is_the_same_however_large_the_systematic_one_is() -> None:
    backbone = Backbone(tuple(noisy_point(90.0, 1e-3, (0, force, 0.1)) for force in (0.1, 0.2, 0.3)), "beam", PHI)
    plain = identify(backbone)
    skewed = identify(backbone, calibration_std=0.02, phase_skew_std_deg=1.0)
    for name in ("modal_frequency_hz", "damping_ratio", "modal_amplitude", "force_n"):
        np.testing.assert_allclose(skewed.random(name), plain.random(name), rtol=0.12)
    np.testing.assert_array_equal(plain.random("damping_ratio"), plain.damping_ratio_std)
    np.testing.assert_allclose(
        np.hypot(skewed.random("damping_ratio"), skewed.systematic("damping_ratio")), skewed.damping_ratio_std, rtol=0.1
    )
    arrays, attributes = encode(skewed)
    again = decode(NonlinearMode, arrays, json.loads(json.dumps(attributes)))
    np.testing.assert_array_equal(again.random("damping_ratio"), skewed.random("damping_ratio"))


def test_errors_of_shapes_that_go_together_do_not_average_over_the_channels() -> None:
    backbone = Backbone((noisy_point(relative=1e-6),))
    std = 0.01 * SHAPE[:, None]
    common = ModeShapes(("drive", "tip"), SHAPE[:, None], 0, std, covariance=std @ std.T)
    apart = ModeShapes(("drive", "tip"), SHAPE[:, None], 0, std)
    together, single = (identify(backbone, mode_shapes=shapes, draws=4000) for shapes in (common, apart))
    assert together.systematic("modal_amplitude") / together.modal_amplitude == pytest.approx(0.01, rel=0.05)
    expected = 0.01 * np.linalg.norm(SHAPE**2) / np.sum(SHAPE**2)
    assert single.systematic("modal_amplitude") / single.modal_amplitude == pytest.approx(expected, rel=0.05)
    assert together.systematic("mac") == pytest.approx(0.0, abs=1e-12)  # the whole shape grows, none of it turns
    with refused(IdentificationError, "shape-for-shape-values", field="covariance"):
        ModeShapes(("drive", "tip"), SHAPE[:, None], covariance=np.eye(1))


def test_a_drift_that_stands_out_of_the_noise_widens_frequency_and_damping() -> None:
    point = noisy_point(relative=1e-5)
    still = identify(Backbone((replace(point, drift=np.zeros(3, complex)),), drive_mode_shape=PHI))
    rate = 0.01 * np.ones(3) * (1 + 1j)
    moving = identify(Backbone((replace(point, drift=rate),), drive_mode_shape=PHI))
    sigma = 0.01 * np.sqrt(2) * point.frequency_hz / point.periods
    assert moving.damping_ratio_std[0] == pytest.approx(sigma / (2 * np.pi * point.frequency_hz), rel=0.1)
    assert moving.damping_ratio_std[0] > 3 * still.damping_ratio_std[0]
    assert moving.modal_frequency_std_hz[0] > 3 * still.modal_frequency_std_hz[0]


def test_gain_and_skew_of_the_sensors_are_counted_where_they_act() -> None:
    backbone = Backbone((noisy_point(relative=1e-7),), drive_mode_shape=PHI)
    gain = identify(backbone, calibration_std={"force": 0.01})
    assert gain.damping_ratio_std[0] == pytest.approx(0.01 * gain.damping_ratio[0], rel=0.1)
    assert gain.modal_frequency_std_hz[0] == pytest.approx(0.0, abs=1e-6)
    skew = identify(backbone, phase_skew_std_deg={"drive": 0.5})
    assert skew.phase_lag_std_deg[0] == pytest.approx(0.5, rel=0.1)
    expected = skew.damping_ratio[0] * skew.modal_frequency_hz[0] * np.radians(0.5)
    assert skew.modal_frequency_std_hz[0] == pytest.approx(expected, rel=0.1)
    both = identify(backbone, calibration_std=0.01)
    assert both.damping_ratio_std[0] == pytest.approx(np.sqrt(2) * 0.01 * both.damping_ratio[0], rel=0.1)


def test_intervals_of_every_quantity_cover_the_truth() -> None:
    rng = np.random.default_rng(7)
    true_points = [noisy_point(lag, 2e-3, (0, force, 0.4 * force)) for lag, force in ((80, 0.1), (90, 0.2), (95, 0.3))]
    shapes_std = 3e-3 * SHAPE[:, None]
    truth = identify(Backbone(tuple(true_points)), mode_shapes=ModeShapes(("drive", "tip"), SHAPE[:, None]))
    hits = {name: [] for name in QUANTITIES}
    for seed in range(250):
        gain = (1 + 5e-3 * rng.standard_normal(3)) * np.exp(1j * np.radians(0.2) * rng.standard_normal(3))
        turned = np.abs(gain)[:, None] * np.exp(1j * np.outer(np.angle(gain), np.arange(3)))
        points = [with_errors(replace(p, harmonics=p.harmonics * turned), rng) for p in true_points]
        shapes = ModeShapes(("drive", "tip"), SHAPE[:, None] + shapes_std * rng.standard_normal((2, 1)), 0, shapes_std)
        mode = identify(
            Backbone(tuple(points)),
            mode_shapes=shapes,
            calibration_std=5e-3,
            phase_skew_std_deg=0.2,
            draws=200,
            seed=seed,
        )
        for name in QUANTITIES:
            low, high = mode.interval(name).T
            value = getattr(truth, name)
            hits[name].append((low <= value + 1e-12) & (value - 1e-12 <= high))
    covered = {name: float(np.mean(hit)) for name, hit in hits.items()}
    bounded = ("mac", "force_purity", "response_purity")  # wider on purpose
    assert all(0.90 <= share <= 0.99 for name, share in covered.items() if name not in bounded), covered
    assert all(covered[name] >= 0.90 for name in bounded), covered


def test_few_periods_widen_the_errors_and_are_named() -> None:
    many, few = noisy_point(), replace(noisy_point(), periods=5)
    wide = identify(Backbone((few,), drive_mode_shape=PHI))
    narrow = identify(Backbone((many,), drive_mode_shape=PHI))
    assert wide.damping_ratio_std[0] > 1.05 * narrow.damping_ratio_std[0]
    assert any("fewer than 10 periods" in note for note in wide.notes)


def test_the_same_seed_gives_the_same_numbers_and_unknown_errors_stay_unknown() -> None:
    backbone = Backbone((noisy_point(),), drive_mode_shape=PHI)
    one, two, other = (identify(backbone, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.damping_ratio_std, two.damping_ratio_std)
    assert one.damping_ratio_std[0] != other.damping_ratio_std[0]
    silent = identify(Backbone((replace(noisy_point(), harmonics_std=None),), drive_mode_shape=PHI))
    for name in STANDARD_ERRORS.values():
        assert np.isnan(getattr(silent, name)).all(), name


def test_a_file_of_an_earlier_version_is_read_with_a_note() -> None:
    mode = identify(Backbone((noisy_point(),), "beam", PHI))
    arrays, attributes = encode(mode)
    again = decode(NonlinearMode, arrays, json.loads(json.dumps(attributes)))
    np.testing.assert_array_equal(again.interval("damping_ratio"), mode.interval("damping_ratio"))
    kept = ("modal_frequency_std_hz", "damping_ratio_std")
    old = {k: v for k, v in arrays.items() if k in kept or ("_std" not in k and k != "interval_95")}
    earlier = decode(NonlinearMode, old, attributes)
    np.testing.assert_array_equal(earlier.damping_ratio_std, mode.damping_ratio_std)
    assert np.isnan(earlier.mac_std).all()
    assert np.isnan(earlier.interval("mac")).all()
    assert "written by an earlier version" in earlier.notes[-1]
    json.dumps(earlier.table(), allow_nan=False)


def test_what_cannot_be_used_is_named() -> None:
    backbone = Backbone((noisy_point(),), drive_mode_shape=PHI)
    with refused(IdentificationError, "no-channel-tap-channels-force-drive", field="calibration_std"):
        identify(backbone, calibration_std={"tap": 0.1})
    with refused(IdentificationError, field="phase_skew_std_deg", value=-1, allowed="0 or above"):
        identify(backbone, phase_skew_std_deg=-1)
    with refused(IdentificationError, field="draws", value=3, allowed="at least 100, or 0 for no standard errors"):
        identify(backbone, draws=3)
    drowned = replace(noisy_point(), harmonics_std=np.ones((3, 3)))
    with refused(IdentificationError, "force-drowns-in-its-standard-error", where="points[0] (0.3 N, 24.37 Hz)"):
        identify(Backbone((drowned,), drive_mode_shape=PHI))
    with refused(IdentificationError, "allowed-force", field="quantity", value="q"):
        identify(backbone).interval("q")
    with refused(IdentificationError, "shape-shapes-have", field="shapes_std"):
        ModeShapes(("drive", "tip"), SHAPE[:, None], shapes_std=np.zeros(1))


def test_without_draws_the_properties_are_the_same_and_their_errors_unknown() -> None:
    backbone = Backbone((noisy_point(80.0, 1e-3),), drive_mode_shape=PHI)
    quick, whole = identify(backbone, draws=0), identify(backbone)
    assert quick.modal_frequency_hz[0] == whole.modal_frequency_hz[0]
    assert quick.damping_ratio[0] == whole.damping_ratio[0]
    assert np.isnan(quick.damping_ratio_std).all()
    assert np.isnan(quick.interval_95).all()
    assert quick.interval_95.shape == whole.interval_95.shape
    with refused(IdentificationError, field="draws", value=99):
        identify(backbone, draws=99)


def test_rounding_is_systematic_and_in_phase_it_moves_force_and_damping_but_not_the_frequency() -> None:
    plain = noisy_point(relative=1e-6)
    rounding = np.zeros(plain.harmonics.shape, complex)
    rounding[0, 1] = 0.01 * abs(plain.harmonics[0, 1])
    std = np.hypot(plain.harmonics_std, np.abs(rounding) / np.sqrt(2.0))
    rounded = replace(plain, rounding_std=rounding, harmonics_std=std)
    mode = identify(Backbone((rounded, rounded), drive_mode_shape=PHI), draws=5000)
    without = identify(Backbone((plain, plain), drive_mode_shape=PHI), draws=5000)
    for name in ("force_n", "damping_ratio"):
        value = getattr(mode, name)
        np.testing.assert_allclose(mode.systematic(name), 0.01 * value, rtol=0.05)
        np.testing.assert_allclose(mode.random(name), without.random(name), rtol=0.1)
        np.testing.assert_allclose(np.diff(mode.interval(name)), 2 * 1.96 * 0.01 * value[:, None], rtol=0.06)
    assert np.all(mode.systematic("modal_frequency_hz") < 1e-6 * mode.modal_frequency_hz)
    assert np.all(mode.systematic("amplitude_m") < 1e-9 * mode.amplitude_m)


def test_rounding_in_quadrature_turns_the_phase_and_so_moves_the_frequency() -> None:
    plain = noisy_point(relative=1e-6)
    rounding = np.zeros(plain.harmonics.shape, complex)
    rounding[0, 1] = 0.01j * abs(plain.harmonics[0, 1])
    std = np.hypot(plain.harmonics_std, np.abs(rounding) / np.sqrt(2.0))
    mode = identify(
        Backbone((replace(plain, rounding_std=rounding, harmonics_std=std),), drive_mode_shape=PHI), draws=5000
    )
    # w^2 = W^2 + (phi F / q) cos psi: one part in a hundred of a radian is z w of it in the frequency.
    expected = 0.01 * mode.damping_ratio * mode.frequency_hz
    np.testing.assert_allclose(mode.systematic("modal_frequency_hz"), expected, rtol=0.05)
    assert mode.systematic("damping_ratio")[0] < 1e-3 * mode.damping_ratio[0]


def test_intervals_at_the_measured_force_hold_its_error_too() -> None:
    rng = np.random.default_rng(3)
    forces, slope, force_std, frequency_std = np.array([0.1, 0.2, 0.2, 0.3]), 2.0, 1e-3, 5e-4
    plain = identify(Backbone(tuple(noisy_point(forces=(0, force, 0)) for force in forces)))
    inside, outside = [], []
    for _ in range(500):
        measured = forces + force_std * rng.standard_normal(4)
        frequency = 25.0 + slope * forces + frequency_std * rng.standard_normal(4)
        intervals = plain.interval_95.copy()
        column = QUANTITIES.index("modal_frequency_hz")
        intervals[:, column] = frequency[:, None] + 1.96 * frequency_std * np.array([-1.0, 1.0])
        known = {"force_n": measured, "force_std_n": np.full(4, force_std), "interval_95": intervals}
        mode = replace(plain, modal_frequency_hz=frequency, **known)
        truth = 25.0 + slope * measured
        for hits, ends in (
            (inside, mode.interval_at("force_n", "modal_frequency_hz")),
            (outside, intervals[:, column]),
        ):
            hits.append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
    assert 0.95 <= np.mean(inside) <= 0.995
    assert np.mean(outside) < 0.5
    single = identify(Backbone((noisy_point(),)))
    assert np.isnan(single.interval_at("force_n", "modal_frequency_hz")).all()
    with refused(IdentificationError, field="axis", value="force", allowed="force_n, amplitude_m"):
        single.interval_at("force", "modal_frequency_hz")
