from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import FrequencyResponseMatrix, IdentificationError, linear_modes
from identification.linear.model_errors import line_scatter
from tests.identification.linear.hardening import (
    CHANNELS,
    CUBIC,
    DAMPING,
    FREQUENCY_HZ,
    LEVELS,
    LINES_HZ,
    SAMPLES,
    inputs,
    measured,
    outputs,
    own_pole,
    spectra,
)
from tests.refused import refused
from tests.sharing import made_once, shared_folder

MANY = 240


@cache
def simulated(level):
    def make(folder):
        np.save(folder / "spectra.npy", spectra(level, MANY, 1))

    return tuple(np.load(made_once(shared_folder() / f"hardening-{level}", make) / "spectra.npy"))


def some(level, realisations, number):
    """A measurement from a few of the realisations, with their noise."""
    u, x = simulated(level)
    part = slice(number * realisations, (number + 1) * realisations)
    return measured(u[part], x[part], number)


def test_the_integration_is_that_of_dop853():
    u = inputs(LEVELS[3], 1, 3)
    w, spectrum = 2 * np.pi * FREQUENCY_HZ, np.fft.rfft(u[0])
    lines = LINES_HZ.astype(int)
    amplitude = spectrum[lines] / SAMPLES

    def slope(t, y):
        now = np.sum((amplitude * np.exp(2j * np.pi * LINES_HZ * t)).real)
        return [y[1], now - 2 * DAMPING * w * y[1] - w**2 * y[0] - CUBIC * y[0] ** 3]

    instants = np.arange(0, 400) / SAMPLES
    exact = solve_ivp(slope, (0.0, instants[-1]), [0.0, 0.0], "DOP853", instants, rtol=1e-9, atol=1e-15).y[0]
    np.testing.assert_allclose(outputs(u, periods=1)[0, :400], exact, atol=5e-4 * np.abs(exact).max())


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("realisations", [5, 1])
def test_the_one_broad_mode_is_found_at_every_level(level, realisations):
    frequency, damping = own_pole(*simulated(level))
    inside, errors = [], []
    for number in range(6):
        modes = linear_modes(some(level, realisations, number))
        assert modes.frequency_hz.size == 1
        errors.append((modes.frequency_hz[0] / frequency - 1.0, modes.damping_ratio[0] / damping - 1.0))
        inside.append(abs(modes.frequency_hz[0] - frequency) < 1.96 * modes.frequency_std_hz[0])
        inside.append(abs(modes.damping_ratio[0] - damping) < 1.96 * modes.damping_ratio_std[0])
    middle = np.abs(np.median(errors, axis=0))
    assert middle[0] < (0.015 if realisations == 5 else 0.04)
    assert middle[1] < (0.2 if realisations == 5 else 0.4)
    assert np.mean(inside) >= 0.75


@pytest.mark.slow
def test_auto_weights_are_nearer_to_the_pole_than_those_of_noise_or_total_variance():
    _, damping = own_pole(*simulated(LEVELS[3]))
    errors = {
        weighting: np.median(
            [linear_modes(some(LEVELS[3], 5, k), weighting=weighting).damping_ratio[0] for k in range(6)]
        )
        / damping
        - 1.0
        for weighting in ("auto", "total")
    }
    assert errors["total"] < -0.15
    assert abs(errors["auto"]) < 0.5 * abs(errors["total"])


@pytest.mark.parametrize("level", LEVELS[2:])
def test_intervals_hold_what_the_choice_of_weights_changes(level):
    responses = some(level, 5, 2)
    found = [linear_modes(responses, weighting=weighting) for weighting in ("auto", "total", "noise", "relative")]
    ratios = [modes.damping_ratio[0] for modes in found]
    assert np.ptp(ratios) > 0.1 * ratios[0]
    for modes in found:
        assert 1.96 * modes.damping_ratio_std[0] > np.max(np.abs(ratios - modes.damping_ratio[0]))
        assert any("depends on the weights" in note for note in modes.notes)


def test_a_damping_that_other_weights_do_not_have_is_not_identified(monkeypatch):
    from identification.linear import model_errors

    responses = some(LEVELS[4], 5, 2)
    monkeypatch.setattr(model_errors, "_LARGEST_MOVE", 1e-6)  # as if the other fits had left for another mode
    modes = linear_modes(responses)
    assert 1.96 * modes.damping_ratio_std[0] > modes.damping_ratio[0]
    assert any("not identified" in note for note in modes.notes)


def test_at_a_low_level_the_weights_stay_those_of_the_total_variance():
    responses = some(LEVELS[0], 5, 0)
    modes, total = linear_modes(responses), linear_modes(responses, weighting="total")
    assert modes.damping_ratio[0] == total.damping_ratio[0]
    assert not any("distortion" in note for note in modes.notes)


def test_the_scatter_of_lines_stands_for_realisations_that_were_not_measured():
    for level in LEVELS[1:]:
        one = linear_modes(some(level, 1, 1), weighting="total")
        assert one.fit_residual == pytest.approx(1.0, abs=0.35)
        assert any("scatter of neighbouring lines" in note for note in one.notes)


def test_line_scatter_is_the_covariance_of_errors_about_a_smooth_curve():
    random = np.random.default_rng(2)
    root = np.array([[1.0, 0.0], [0.6 + 0.3j, 0.5]])
    errors = (random.normal(size=(4000, 2)) + 1j * random.normal(size=(4000, 2))) / np.sqrt(2.0) @ root.T
    x = np.linspace(0.0, 20.0, 4000)[:, None]
    found = line_scatter(errors + 5.0 * np.exp(1j * x) * np.array([1.0, 2.0j]))
    np.testing.assert_allclose(found.mean(axis=0), root @ np.conj(root.T), atol=0.03)
    assert line_scatter(errors[:8]) is None


def test_what_is_no_mode_is_refused_and_starting_frequencies_are_asked_for():
    random = np.random.default_rng(4)
    noise = random.normal(size=(LINES_HZ.size, 1, 1)) + 1j * random.normal(size=(LINES_HZ.size, 1, 1))
    nothing = FrequencyResponseMatrix(outputs=CHANNELS[1:], inputs=CHANNELS[:1], frequency_hz=LINES_HZ, value=noise)
    with refused(IdentificationError, field="modes"):
        linear_modes(nothing)


def test_a_starting_frequency_that_is_far_off_leads_to_the_mode():
    responses = some(LEVELS[3], 5, 0)
    found = linear_modes(responses)
    for start in (60.0, 100.0):
        near = linear_modes(responses, modes=[start])
        assert near.frequency_hz[0] == pytest.approx(found.frequency_hz[0], rel=1e-3)
