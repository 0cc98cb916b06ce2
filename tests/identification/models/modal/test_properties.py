import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from identification import ExtrapolationError, IdentificationError, ModalProperties
from tests.identification.models.modal.modes import SHAPE, duffing, mode_with
from tests.refused import refused

Q = np.array([1.0, 2.0, 3.0, 5.0, 8.0]) * 1e-3
HZ = np.array([24.0, 24.1, 23.9, 24.5, 25.0])
Z = np.array([0.004, 0.006, 0.005, 0.0052, 0.007])


def test_between_levels_properties_are_the_monotone_cubic_and_at_levels_the_identified_ones() -> None:
    found = ModalProperties.of(mode_with(Q, HZ, Z))
    q = np.linspace(Q[0], Q[-1], 301)
    np.testing.assert_allclose(found.frequency_rad_s(q), PchipInterpolator(Q, 2 * np.pi * HZ)(q), rtol=1e-13)
    np.testing.assert_allclose(found.damping_ratio(q), PchipInterpolator(Q, Z)(q), rtol=1e-13)
    np.testing.assert_allclose(found.damping_ratio(Q), Z, rtol=1e-13)
    np.testing.assert_allclose(found.drive_shape(q), SHAPE, rtol=1e-13)
    assert found.q_range == (Q[0], Q[-1])


def test_below_the_lowest_level_properties_are_constant() -> None:
    found = ModalProperties.of(mode_with(Q, HZ, Z))
    np.testing.assert_allclose(found.frequency_rad_s([0.0, 1e-5, 9e-4]), 2 * np.pi * HZ[0], rtol=1e-14)
    np.testing.assert_allclose(found.damping_ratio([0.0, 1e-5, 9e-4]), Z[0], rtol=1e-14)


def test_a_duffing_oscillator_is_continued_exactly() -> None:
    q = np.array([1.2, 1.5, 2.0]) * 8e-3
    found = ModalProperties.of(duffing(Q, hardening=900.0)).frequency_rad_s(q)
    np.testing.assert_allclose(found, 2 * np.pi * 24.0 * np.sqrt(1.0 + 900.0 * q**2), rtol=1e-12)


def test_damping_is_continued_rising_but_never_falling() -> None:
    rising = ModalProperties.of(mode_with(Q, damping=0.004 + 0.5 * Q))
    assert rising.damping_ratio(0.012) == pytest.approx(0.004 + 0.5 * 0.012, rel=1e-12)
    falling = ModalProperties.of(mode_with(Q, damping=0.008 - 0.5 * Q))
    assert falling.damping_ratio(0.012) == falling.damping_ratio(0.008) == pytest.approx(0.004, rel=1e-12)


def test_the_slopes_at_the_end_are_those_of_the_last_levels_not_of_the_last_difference() -> None:
    noisy = 0.004 + 0.5 * Q
    noisy[-2] = noisy[-1] * 1.02
    found = ModalProperties.of(mode_with(Q, damping=noisy))
    assert found.damping_ratio(0.012) > found.damping_ratio(0.008)


def test_a_strongly_softening_mode_keeps_a_real_frequency() -> None:
    found = ModalProperties.of(mode_with([1e-3, 2e-3], [24.0, 14.0]))
    assert np.all(found.frequency_rad_s(np.linspace(2e-3, 4e-3, 50)) > 0.0)


def test_slopes_are_those_of_finite_differences_inside_and_outside() -> None:
    found = ModalProperties.of(mode_with(Q, HZ, Z, apparent_mass_kg=SHAPE**-2 * (1 + 20 * Q)))
    q = np.array([0.5e-3, 1.3e-3, 2.4e-3, 3.9e-3, 7.7e-3, 9e-3, 15e-3])
    h = 1e-8
    for function, slope in zip(
        (found.frequency_rad_s, found.damping_ratio, found.drive_shape), found.slopes(q), strict=True
    ):
        difference = (function(q + h) - function(q - h)) / (2 * h)
        np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max())


def test_the_plain_arrays_give_the_same_by_the_documented_recipe() -> None:
    found = ModalProperties.of(mode_with(Q, HZ, Z))

    def recipe(q: float) -> tuple[float, float]:
        last = found.modal_amplitude[-1]
        if q > last:
            squared = max(found.tail[0], found.tail[1] + found.tail[2] * (q**2 - last**2))
            return squared**0.5, found.tail[3] + found.tail[4] * (q - last)
        held = max(q, found.modal_amplitude[0])
        k = min(int(np.sum(found.modal_amplitude <= held)) - 1, found.omega_coefficients.shape[1] - 1)
        t = held - found.modal_amplitude[k]
        return np.polyval(found.omega_coefficients[:, k], t), np.polyval(found.damping_coefficients[:, k], t)

    q = np.linspace(0.0, 16e-3, 200)
    np.testing.assert_allclose(found.frequency_rad_s(q), [recipe(v)[0] for v in q], rtol=1e-13)
    np.testing.assert_allclose(found.damping_ratio(q), [recipe(v)[1] for v in q], rtol=1e-13)


def test_order_and_repeats_do_not_matter() -> None:
    order = np.array([4, 0, 2, 1, 3])
    q = np.r_[Q[order], Q * 1.004]
    repeated = mode_with(q, np.r_[HZ[order], HZ + 0.02], np.r_[Z[order], Z * 1.02])
    found = ModalProperties.of(repeated)
    np.testing.assert_allclose(found.modal_amplitude, Q * 1.002, rtol=1e-12)
    np.testing.assert_allclose(found.omega_rad_s, 2 * np.pi * (HZ + 0.01), rtol=1e-12)
    np.testing.assert_allclose(found.damping, Z * 1.01, rtol=1e-12)


def test_beyond_twice_the_largest_amplitude_is_refused_unless_allowed() -> None:
    found = ModalProperties.of(mode_with(Q, HZ, Z))
    assert found.range_use(12e-3) == pytest.approx(1.5)
    assert np.isfinite(found.damping_ratio(2.0 * Q[-1]))
    with refused(ExtrapolationError, "kg-is-times-the-largest-identified"):
        found.frequency_rad_s([1e-3, 16.1e-3])
    allowed = ModalProperties.of(mode_with(Q, HZ, Z), largest_range_use=np.inf)
    assert np.isfinite(allowed.frequency_rad_s(50e-3))


def test_one_level_is_a_linear_mode() -> None:
    found = ModalProperties.of(mode_with(1e-3, 24.0, 0.005))
    np.testing.assert_allclose(found.frequency_rad_s([0.0, 1e-3, 2e-3]), 2 * np.pi * 24.0, rtol=1e-14)
    np.testing.assert_array_equal(found.slopes([0.5e-3, 1e-3, 1.5e-3]), np.zeros((3, 3)))


def test_apparent_masses_stand_in_for_modal_amplitudes() -> None:
    mass = np.array([1.8, 1.9, 1.9, 2.0, 2.1])
    mode = mode_with(Q, HZ, Z, modal_amplitude=np.full(5, np.nan), amplitude_m=Q / np.sqrt(mass), apparent_mass_kg=mass)
    found = ModalProperties.of(mode)
    np.testing.assert_allclose(found.modal_amplitude, Q, rtol=1e-12)
    np.testing.assert_allclose(found.drive_shape(Q) * Q, mode.amplitude_m, rtol=1e-12)


def test_total_power_is_asked_for_by_name() -> None:
    mode = mode_with(Q, HZ, Z, damping_ratio_total_power=0.9 * Z)
    np.testing.assert_allclose(ModalProperties.of(mode, damping="total-power").damping, 0.9 * Z, rtol=1e-14)


def test_what_cannot_be_used_is_named() -> None:
    unknown = np.full(5, np.nan)
    with refused(IdentificationError, "no-level-has-modal-amplitude-and", field="mode"):
        ModalProperties.of(mode_with(Q, HZ, Z, damping_ratio_total_power=unknown), damping="total-power")
    with refused(IdentificationError, field="damping", allowed="above zero"):
        ModalProperties.of(mode_with(Q, HZ, Z * [-1, 1, 1, 1, 1]))
    with refused(IdentificationError, field="damping", value="all", allowed="fundamental, total-power"):
        ModalProperties.of(mode_with(Q), damping="all")  # type: ignore[arg-type]
    with refused(IdentificationError, "each-above-the-one-before", field="modal_amplitude"):
        ModalProperties.from_levels([2.0, 1.0], [1.0, 1.0], [0.1, 0.1], 1.0)


def test_the_continuation_does_not_depend_on_how_densely_the_test_was_stepped() -> None:
    """A damping that turns flat: with a fixed number of levels a denser test would have a flatter continuation."""
    slopes = []
    for levels in (11, 101):
        q = np.linspace(0.0, 1e-2, levels)[1:]
        slopes.append(ModalProperties.from_levels(q, 150.0 - 400.0 * q, 0.01 * (1.0 - np.exp(-q / 5e-3)), 1.0).tail)
    np.testing.assert_allclose(slopes[1][[2, 4]], slopes[0][[2, 4]], rtol=0.05)
    assert slopes[0][4] > 0.0
