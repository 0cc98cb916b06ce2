import numpy as np
import pytest
from scipy.signal import lfilter

from identification import (
    Channel,
    IdentificationError,
    MultisineDesign,
    PeriodicSpectra,
    best_linear_approximation,
    periodic_spectra,
)
from tests.refused import refused

CHANNELS = (
    Channel("voltage", "monitor", "V"),
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s2"),
)
DESIGN = MultisineDesign(1000.0, 500, 20.0, 200.0)
FORCE_FILTER = ([0.5, 0.3], [1.0, -0.4])  # voltage -> force
DRIVE_FILTER = ([1.0, -1.0], [1.0, -1.2, 0.8])  # voltage -> response
PERIODS, SETTLING = 6, 2


def gain(filter_: tuple[list[float], list[float]], frequency_hz: np.ndarray) -> np.ndarray:
    z = np.exp(2j * np.pi * frequency_hz / 1000.0)
    return np.polyval(filter_[0], z) * z ** (len(filter_[1]) - len(filter_[0])) / np.polyval(filter_[1], z)


def records(noise: float, realisations: int, seed: int = 0, design: MultisineDesign = DESIGN) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    result = []
    for index in range(realisations):
        voltage = np.tile(design.realisation(seed, index), PERIODS + SETTLING)
        force = lfilter(*FORCE_FILTER, voltage) + noise * random.normal(size=voltage.size)
        drive = lfilter(*DRIVE_FILTER, voltage) + noise * random.normal(size=voltage.size)
        result.append(np.array([voltage, force, drive]))
    return result


def spectra(noise: float, realisations: int, seed: int = 0, design: MultisineDesign = DESIGN) -> PeriodicSpectra:
    return periodic_spectra(records(noise, realisations, seed, design), CHANNELS, design, transient_periods=SETTLING)


def test_a_linear_rig_without_noise_returns_its_own_frequency_response() -> None:
    measured = spectra(0.0, 2)
    response = measured.frequency_response("drive")
    expected = gain(DRIVE_FILTER, response.frequency_hz) / gain(FORCE_FILTER, response.frequency_hz)
    np.testing.assert_allclose(response.value, expected, rtol=1e-9)
    assert np.max(response.noise_std) < 1e-9
    assert np.max(response.total_std) < 1e-9
    assert response.unit == "m/s2/N"


def test_spectra_are_peak_amplitudes_against_the_start_of_the_period() -> None:
    measured = spectra(0.0, 1)
    time = np.arange(DESIGN.period_samples) / DESIGN.sample_rate_hz
    turn = 2 * np.pi * np.outer(time, measured.frequency_hz)
    rebuilt = (np.exp(1j * turn) @ measured.spectra[0, 0, 0]).real
    np.testing.assert_allclose(rebuilt, DESIGN.realisation(0, 0), atol=1e-12)
    assert measured.rms("voltage") == pytest.approx(1.0)


def test_noise_variance_is_that_of_white_noise() -> None:
    # White noise of deviation s leaves 2 s sqrt(1/N) in a peak amplitude: E|Y|^2 = 4 s^2 / N.
    measured = spectra(0.1, 20)
    expected = 4 * 0.1**2 / DESIGN.period_samples
    force = measured.noise_variance[:, 1]
    assert force.mean() == pytest.approx(expected, rel=5 / np.sqrt(force.size * (PERIODS - 1)))
    assert measured.noise_std[1].mean() == pytest.approx(np.sqrt(expected / PERIODS), rel=0.05)
    assert np.max(measured.noise_variance[:, 0]) < 1e-20


def test_deviations_of_the_frequency_response_cover_its_errors() -> None:
    squared, noise, total = [], [], []
    for seed in range(40):
        response = spectra(0.05, 4, seed).frequency_response("drive")
        expected = gain(DRIVE_FILTER, response.frequency_hz) / gain(FORCE_FILTER, response.frequency_hz)
        squared.append(np.abs(response.value - expected) ** 2)
        noise.append(response.noise_std**2)
        total.append(response.total_std**2)
    ratio = np.mean(np.array(squared) / np.mean(noise, axis=0))
    assert ratio == pytest.approx(1.0, abs=5 / np.sqrt(np.size(squared)))
    # A linear rig distorts nothing: the scatter over realisations is the noise.
    assert np.mean(total) == pytest.approx(np.mean(noise), rel=0.1)


def test_noise_on_the_force_biases_h1_and_not_the_instrumental_estimate() -> None:
    expected = gain(DRIVE_FILTER, DESIGN.frequency_hz) / gain(FORCE_FILTER, DESIGN.frequency_hz)
    instrument, h1 = [], []
    for seed in range(20):
        measured = spectra(1.0, 4, seed)
        instrument.append(measured.frequency_response("drive").value)
        _, force, drive = np.moveaxis(measured.mean, 1, 0)
        h1.append(np.sum(drive * np.conj(force), axis=0) / np.sum(np.abs(force) ** 2, axis=0))
    assert abs(np.mean(instrument / expected) - 1.0) < 0.01
    assert abs(np.mean(h1 / expected) - 1.0) > 0.03


def test_scatter_over_realisations_sees_what_periods_do_not() -> None:
    recorded = records(0.0, 6)
    for record in recorded:
        record[2] += 0.2 * record[0] ** 3
    response = periodic_spectra(recorded, CHANNELS, DESIGN, transient_periods=SETTLING).frequency_response("drive")
    assert np.median(response.total_std) > 1e6 * np.median(response.noise_std)


def test_lines_that_an_odd_grid_leaves_out_are_kept_and_marked() -> None:
    design = MultisineDesign(1000.0, 500, 20.0, 200.0, "odd")
    recorded = records(0.0, 1, design=design)
    recorded[0][2] += recorded[0][0] ** 2
    measured = periodic_spectra(recorded, CHANNELS, design, transient_periods=SETTLING)
    assert measured.frequency_hz.size == 91
    assert measured.excited.sum() == 45
    amplitude = measured.amplitude
    assert np.max(amplitude[0, ~measured.excited]) < 1e-12
    # A square of odd lines lies on even lines only.
    assert np.median(amplitude[2, ~measured.excited]) > 1e-3
    clean = periodic_spectra(records(0.0, 1, design=design), CHANNELS, design, transient_periods=SETTLING)
    np.testing.assert_allclose(amplitude[2, measured.excited], clean.amplitude[2, measured.excited], rtol=1e-9)


def test_one_period_and_one_realisation_say_nothing_of_noise() -> None:
    record = records(0.1, 1)[0][:, -DESIGN.period_samples :]
    response = periodic_spectra([record], CHANNELS, DESIGN).frequency_response("drive")
    assert np.all(np.isnan(response.noise_std))
    assert np.all(np.isnan(response.total_std))
    assert np.all(np.isfinite(response.value))


def test_records_that_do_not_fit_are_named() -> None:
    good = records(0.0, 2)
    with refused(
        IdentificationError, "shape-4", field="records[0]", allowed="3 channels by whole periods of 500 samples"
    ):
        periodic_spectra([good[0][:, :-1]], CHANNELS, DESIGN)
    with refused(IdentificationError, "has-periods", field="records[0]", allowed="more than transient_periods = 8"):
        periodic_spectra(good, CHANNELS, DESIGN, transient_periods=8)
    with refused(IdentificationError, "have-settled-periods", field="records"):
        periodic_spectra([good[0], good[1][:, 500:]], CHANNELS, DESIGN)
    with refused(IdentificationError, "empty", field="records"):
        periodic_spectra([], CHANNELS, DESIGN)
    silent = [np.array([0 * record[0], record[1], record[2]]) for record in good]
    with refused(IdentificationError, "gives-no-input-at-hz", field="instrument 'voltage'"):
        periodic_spectra(silent, CHANNELS, DESIGN).frequency_response("drive")


def test_a_band_near_half_the_sample_rate_is_noted() -> None:
    assert spectra(0.0, 1).notes == ()
    design = MultisineDesign(1000.0, 500, 20.0, 300.0)
    near = spectra(0.0, 1, design=design)
    assert "degree 3 of a band up to 300" in near.notes[0]
    assert best_linear_approximation(near).notes[0] == near.notes[0]


def test_lines_are_even_or_odd_multiples_of_the_resolution() -> None:
    measured = spectra(0.0, 1)
    assert measured.frequency_hz[:3].tolist() == [20.0, 22.0, 24.0]
    assert measured.even[:3].tolist() == [True, False, True]
    single = MultisineDesign(1000.0, 500, 20.0, 20.0)
    with refused(
        IdentificationError, field="frequency_hz", allowed="two lines or more, all neighbours equally far apart"
    ):
        _ = spectra(0.0, 1, design=single).even


def test_lines_of_no_amplitude_are_not_excited() -> None:
    design = MultisineDesign(1000.0, 500, 20.0, 26.0, relative_amplitudes=(1.0, 0.0, 1.0, 1.0))
    measured = spectra(0.0, 2, design=design)
    assert measured.excited.tolist() == [True, False, True, True]
    assert measured.frequency_response("drive").frequency_hz.tolist() == [20.0, 24.0, 26.0]
