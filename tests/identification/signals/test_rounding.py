"""What rounding leaves in Fourier coefficients, against rounded records of other sizes and between other two steps."""

import numpy as np
import pytest

from identification import Channel, IdentificationError, periodic_vibration
from identification.signals.rounding import part_of_each, rounding_errors
from identification.signals.turns import turns_of
from tests.refused import refused

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"))
HARMONICS = np.array([0.0, 1.0, 0.2, 0.05j])
THETA = 2.0 * np.pi * np.arange(10_260) / 205.17  # fifty periods


def record(
    peak_steps: float, noise_steps: float, offset: float, rng: np.random.Generator, theta: np.ndarray = THETA
) -> np.ndarray:
    """A record rounded to whole numbers."""
    exact = offset + np.real(np.exp(1j * np.outer(theta, np.arange(4))) @ (peak_steps * HARMONICS))
    return np.round(exact + noise_steps * rng.standard_normal(theta.size))


def errors_seen(peak_steps: float, noise_steps: float, offsets: np.ndarray, theta: np.ndarray = THETA) -> np.ndarray:
    """Errors of the coefficients in steps, complex[offsets and sizes, 3], in phase with each coefficient and in quadrature."""
    rng, errors = np.random.default_rng(3), []
    for offset in offsets:
        for peak in peak_steps + np.array([-0.25, 0.0, 0.25]):
            rounded = record(float(peak), noise_steps, float(offset), rng, theta)
            found = periodic_vibration(theta, [rounded, rounded], CHANNELS, sample_rate_hz=5000.0, harmonics=3)
            away = found.harmonics[0, 1:] - peak * HARMONICS[1:]
            errors.append(away * np.conj(HARMONICS[1:]) / np.abs(HARMONICS[1:]))
    return np.array(errors)


def stated(peak_steps: float, noise_steps: float, theta: np.ndarray = THETA) -> np.ndarray:
    """Stated standard errors in steps, complex[3]."""
    return rounding_errors(turns_of(theta, 3), peak_steps * HARMONICS[None], np.ones(1), np.array([noise_steps]))[0, 1:]


@pytest.mark.parametrize(("peak_steps", "noise_steps"), [(9.6, 0.05), (9.6, 0.17), (3.3, 0.1)])
def test_rounding_errors_hold_those_of_rounded_records_and_are_not_far_above(
    peak_steps: float, noise_steps: float
) -> None:
    seen = errors_seen(peak_steps, noise_steps, np.linspace(-0.5, 0.5, 16, endpoint=False))
    std = stated(peak_steps, noise_steps)
    assert np.mean(np.abs(seen.real) <= 1.96 * std.real) > 0.95
    assert np.mean(np.abs(seen.imag) <= 1.96 * std.imag + 0.01) > 0.95  # 0.01: what noise of a tenth of a step leaves
    assert np.all(std.real < 3.0 * np.sqrt(np.mean(seen.real**2, axis=0)))


def test_a_sine_between_steps_has_an_error_of_amplitude_and_none_of_phase() -> None:
    """The fundamental of ``sin(2 pi A cos(theta))`` is ``2 J_1(2 pi A)``: in phase, and of either sign."""
    sine = np.array([[0.0, 7.0, 0.0, 0.0]])
    in_phase, across = (
        part(rounding_errors(turns_of(THETA, 3), sine, np.ones(1), np.zeros(1))[0, 1]) for part in (np.real, np.imag)
    )
    assert in_phase == pytest.approx(np.sqrt(0.5) * 2.0 / np.pi * np.sqrt(2.0 / (np.pi * 2.0 * np.pi * 7.0)), rel=0.4)
    assert across < 0.1 * in_phase


def test_instants_that_come_again_in_every_period_leave_more_than_instants_that_do_not() -> None:
    again = 2.0 * np.pi * np.arange(20 * 50) / 20.0
    across = np.array([[0.0, 300.0, 0.0, 0.0]])
    kept, spread = (
        part_of_each(rounding_errors(turns_of(theta, 3), across, np.ones(1), np.zeros(1)))[0, 1]
        for theta in (again, again * 20.0 / 20.617)
    )
    rounded = np.round(300.3 * np.cos(again))
    seen = np.abs(2.0 * np.mean((rounded - 300.3 * np.cos(again)) * np.exp(-1j * again)))
    assert kept > 2.0 * spread
    assert seen < 4.0 * kept


def test_noise_of_half_a_step_leaves_nothing_of_it_and_no_step_is_no_rounding() -> None:
    peak = 9.6 * HARMONICS[None]
    assert np.all(rounding_errors(turns_of(THETA, 3), peak, np.ones(1), np.array([0.6])) == 0.0)
    assert np.all(rounding_errors(turns_of(THETA, 3), peak, np.zeros(1), np.array([0.0])) == 0.0)


def test_the_scatter_of_a_record_does_not_know_of_the_rounding_that_its_standard_error_counts() -> None:
    rounded = record(9.6, 0.05, 0.2, np.random.default_rng(4))
    options = {"sample_rate_hz": 5000.0, "harmonics": 3}
    blind = periodic_vibration(THETA, [rounded, rounded], CHANNELS, **options)
    known = periodic_vibration(THETA, [rounded, rounded], CHANNELS, resolution=[1.0, 0.0], **options)
    assert blind.rounding_std is None
    assert known.rounding_std is not None
    assert known.harmonics_std[0, 1] > 3.0 * blind.harmonics_std[0, 1]
    np.testing.assert_allclose(
        np.hypot(blind.harmonics_std, part_of_each(known.rounding_std)), known.harmonics_std, rtol=1e-12
    )
    np.testing.assert_array_equal(known.harmonics_std[1], blind.harmonics_std[1])


def test_harmonics_beyond_those_asked_for_count_in_the_shape_but_are_not_returned() -> None:
    theta = THETA
    exact = 9.6 * np.cos(theta) + 0.3 * np.cos(9.0 * theta + 1.0)  # turns part of the error by 90 degrees
    noisy = np.round(exact + 0.17 * np.random.default_rng(5).standard_normal(theta.size))
    found = periodic_vibration(
        theta,
        [noisy, noisy],
        CHANNELS,
        sample_rate_hz=5000.0,
        harmonics=3,
        resolution=[1.0, 1.0],
        noise_rms=[0.17, 0.17],
    )
    assert found.rounding_std is not None
    assert found.rounding_std.shape == (2, 4)
    assert abs(found.harmonics[0, 1].imag) < 1.96 * np.hypot(found.rounding_std[0, 1].imag, found.harmonics_std[0, 1])
    plain = rounding_errors(turns_of(theta, 3), np.array([[0.0, 9.6, 0.0, 0.0]]), np.ones(1), np.array([0.17]))[0, 1]
    assert found.rounding_std[0, 1].imag > 2.0 * plain.imag


@pytest.mark.parametrize("name", ["resolution", "noise_rms"])
@pytest.mark.parametrize("values", [[1.0], [1.0, -1.0]])
def test_steps_and_noise_that_do_not_fit_are_named(name: str, values: list[float]) -> None:
    rounded = record(9.6, 0.05, 0.2, np.random.default_rng(5))
    with refused(IdentificationError, field=name, value=values, allowed="2 numbers of 0 or above, one per channel"):
        periodic_vibration(THETA, [rounded, rounded], CHANNELS, sample_rate_hz=5000.0, **{name: values})


def test_turns_are_powers_of_the_first_and_lower_harmonics_alone_have_the_same_errors() -> None:
    angles = np.outer(np.arange(31), THETA)
    for lower in (None, turns_of(THETA, 7), turns_of(THETA, 30)):
        found = turns_of(THETA, 30, lower=lower)
        np.testing.assert_allclose(found, [np.cos(angles), -np.sin(angles)], atol=1e-11)
    given = turns_of(THETA, 3), 9.6 * HARMONICS[None], np.ones(1), np.array([0.05])
    np.testing.assert_allclose(rounding_errors(*given, 2), rounding_errors(*given)[:, :3], rtol=1e-12)


@pytest.mark.parametrize("noise_steps", [0.0, 0.05, 0.2])
def test_the_error_is_the_sum_of_its_sines_at_every_sample(noise_steps: float) -> None:
    orders = np.arange(1, 7)
    sizes = np.exp(-2.0 * (np.pi * orders * noise_steps) ** 2) / (np.pi * orders)
    sizes = np.where(sizes < 1e-3, 0.0, sizes) * (-1.0) ** orders
    shape = 0.2 * HARMONICS  # a quarter of a step less is nothing
    exact = np.real(np.exp(1j * np.outer(THETA, np.arange(4))) @ shape)
    squared = []
    for change in (-0.25, 0.0, 0.25):
        position = exact * max(0.0, 1.0 + change / np.abs(exact).max())
        errors = [np.sin(2.0 * np.pi * np.outer(position + at, orders)) @ sizes for at in (0.0, 0.25)]
        found = 2.0 / THETA.size * np.exp(-1j * np.outer(np.arange(1, 4), THETA)) @ np.transpose(errors)
        along = found * np.conj(shape[1:] / np.abs(shape[1:]))[:, None]
        squared.append([np.sum(along.real**2, axis=1), np.sum(along.imag**2, axis=1)])
    in_phase, across = np.sqrt(np.max(squared, axis=0))
    seen = rounding_errors(turns_of(THETA, 3), shape[None], np.ones(1), np.array([noise_steps]))[0, 1:]
    np.testing.assert_allclose(seen, np.sqrt(0.5) * in_phase + 1j * across, rtol=1e-10, atol=1e-15)
