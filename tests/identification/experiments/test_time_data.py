"""Time records as experiments and frequency responses, against the systems that made them."""

import numpy as np
import pytest
import scipy

from identification import (
    Channel,
    FitSettings,
    IdentificationError,
    TimeRecord,
    TimeRecords,
    identify_pnlss,
    linear_modes,
    time_experiments,
    time_responses,
)
from identification.experiments.periodicity import period_remark
from identification.experiments.time_responses import time_spectra
from tests.refused import refused

FORCE, DRIVE, VOLT = Channel("force", "force", "V"), Channel("out", "drive", "V"), Channel("gen", "monitor", "V")
RATE_HZ, SIZE, F0, ZETA = 512.0, 512, 40.0, 0.02


def response(frequency_hz, shift=0.0):
    """Displacement over force of one mode, a continuous system under a band-limited force: closed form."""
    s, w = 2j * np.pi * np.asarray(frequency_hz), 2 * np.pi * F0 * (1.0 + shift)
    return 1.0 / (s**2 + 2 * ZETA * w * s + w**2)


def multisines(periods=3, noise=0.0, seed=0, realisations=3, noisy=(0, 1)):
    """Records of a steady mode: the spectrum of the force times the closed form, period after period."""
    random = np.random.default_rng(seed)
    lines, found = np.arange(5, 150), []
    for number in range(realisations):
        spectrum = np.zeros(SIZE // 2 + 1, complex)
        spectrum[lines] = SIZE / 2 * np.exp(2j * np.pi * random.random(lines.size))
        of_output = spectrum * np.nan_to_num(response(np.arange(SIZE // 2 + 1) * RATE_HZ / SIZE))
        one = np.array([np.fft.irfft(spectrum), np.fft.irfft(of_output), np.fft.irfft(3.0 * spectrum)])
        samples = np.tile(one, periods)
        for row in noisy:
            samples[row] += noise * one[row].std() * random.normal(size=samples.shape[1])
        found.append(TimeRecord(samples=samples, name=f"realisation {number + 1}", level=1.0))
    return TimeRecords(
        channels=(FORCE, DRIVE, VOLT),
        sample_rate_hz=RATE_HZ,
        records=tuple(found),
        period_samples=SIZE,
        instrument="gen",
    )


def test_periods_are_averaged_and_put_ahead():
    data = multisines(periods=4, noise=0.1)
    one = time_experiments(data, outputs=["out"])[0]
    mean = data.records[0].samples.reshape(3, 4, SIZE).mean(axis=1)
    np.testing.assert_allclose(one.counted_inputs[0], mean[0], rtol=1e-12)
    np.testing.assert_allclose(one.outputs[0], np.tile(mean[1], 2), rtol=1e-12)
    assert (one.period_samples, one.counted_from, one.initial_state) == (SIZE, SIZE, "zero")
    clean = time_experiments(multisines(), outputs=["out"])[0]
    assert clean.excited_hz == (5.0, 149.0)  # by the lines of the input
    # The standard error of a line's amplitude under white noise of deviation s: s sqrt(4 / (N periods)).
    size = 0.1 * data.records[0].samples[1].std() / np.sqrt(1.01)
    assert np.sqrt(np.mean(one.output_noise**2)) == pytest.approx(size * np.sqrt(4.0 / (SIZE * 4)), rel=0.1)


def test_oversampled_data_with_a_known_band_get_a_rate_that_suits_it():
    data = multisines()
    slow = TimeRecords(**{**vars(data), "excited_hz": (5.0, 8.0)})
    one = time_experiments(slow)[0]
    assert (one.sample_rate_hz, one.period_samples) == (200.0, 200)
    with refused(IdentificationError, "period-of-samples-at-hz-then", field="rate_hz", value=100.5):
        time_experiments(data, rate_hz=100.5)


def test_responses_of_periodic_records_are_those_of_the_mode_and_keep_the_volts():
    found = time_responses(multisines())
    np.testing.assert_allclose(found.value[:, 0, 0], response(found.frequency_hz), rtol=1e-9)
    assert (found.inputs[0].unit, found.outputs[0].unit, found.frequency_hz[0]) == ("V", "V", 5.0)
    modes = linear_modes(time_responses(multisines(noise=0.01)))
    assert modes.frequency_hz == pytest.approx([F0], abs=4 * modes.frequency_std_hz[0])
    assert modes.damping_ratio == pytest.approx([ZETA], abs=4 * modes.damping_ratio_std[0])


def with_force_noise(share, **changes):
    """Records whose force has noise of a share of its RMS, and no instrument."""
    return TimeRecords(**{**vars(multisines(noise=share, noisy=(0,))), "instrument": "", **changes})


@pytest.mark.parametrize("evaluate", [time_responses, time_experiments])
def test_data_without_periods_are_not_evaluated_as_periodic(evaluate):
    random = np.random.default_rng(3)
    records = tuple(TimeRecord(samples=random.normal(size=(3, 4 * SIZE)), name=f"noise {n}") for n in (1, 2))
    told = {"says": "in-record-noise-such-periods-of", "field": "period_samples", "value": 512, "allowed": "up to 50 %"}
    with refused(IdentificationError, **told):
        evaluate(with_force_noise(0.0, records=records))
    with refused(IdentificationError, "differ-by", field="period_samples", value=384):
        evaluate(with_force_noise(0.0, period_samples=384))  # a wrong length of the period
    evaluate(with_force_noise(0.3))
    evaluate(with_force_noise(0.0, records=tuple(TimeRecord(samples=random.normal(size=(3, SIZE))) for _ in range(2))))


def test_an_instrument_that_is_periodic_lets_the_force_be_noisy():
    assert period_remark(multisines(noise=1.0, noisy=(0,))) == ""
    assert period_remark(with_force_noise(0.01)) == ""
    # Noise of a share n of the signal's RMS is n / sqrt(1 + n^2) of that of both.
    remark = period_remark(with_force_noise(0.2))
    assert float(remark.split("up to ")[1].split(" %")[0]) == pytest.approx(100.0 * 0.2 / np.sqrt(1.04), rel=0.06)


def test_noise_in_the_force_biases_the_responses_only_without_an_instrument():
    data = multisines(periods=2, noise=1.0, realisations=8, noisy=(0,))
    share = {}
    for estimator in ("instrument", "H1"):
        found = time_responses(data, estimator=estimator)
        share[estimator] = np.mean(np.real(found.value[:, 0, 0] / response(found.frequency_hz)))
    # The force has its power in 145 lines, noise of equal power in 256 of them, halved by the mean of two periods.
    assert share["H1"] == pytest.approx(1.0 / (1.0 + 0.5 * 145 / 256), abs=0.06)
    assert share["instrument"] == pytest.approx(1.0, abs=0.08)


def random_records(at_rest, count=1, samples=6000, cubic=0.0):
    """Records of a mode in discrete time, ``x(k+1) = ...`` with a cubic spring: a nonlinear state-space model itself."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(count):
        u = scipy.signal.lfilter(*scipy.signal.butter(2, 0.5), random.normal(size=samples + 100))
        x = np.zeros((2, samples + 101))
        for k in range(samples + 100):
            x[1, k + 1] = 0.97 * x[1, k] - 0.3 * x[0, k] - cubic * x[0, k] ** 3 + 0.2 * u[k]
            x[0, k + 1] = x[0, k] + 0.3 * x[1, k + 1]
        first = 0 if at_rest else 100
        found.append(TimeRecord(samples=np.array([u, x[0, :-1]])[:, first : first + samples], name="random", level=1.0))
    return TimeRecords(channels=(FORCE, DRIVE), sample_rate_hz=100.0, records=tuple(found), at_rest=at_rest)


@pytest.mark.parametrize("at_rest", [True, False])
def test_data_without_periods_are_enough_for_a_nonlinear_state_space_model(at_rest):
    data = time_experiments(random_records(at_rest, 2, 3000, cubic=0.02))
    assert data[0].initial_state == ("zero" if at_rest else "estimated")
    found = identify_pnlss(
        data[:1], states=2, degrees=(3,), output_degrees=(), validation=data[1:], settings=FitSettings(iterations=30)
    )
    assert "responses of a regression" in " ".join(found.model.notes)
    # The records are those of such a model without noise: what is left is how far the fit has come.
    assert found.validation_error < 1e-3


def test_decimated_records_lose_their_spoilt_ends():
    data = random_records(at_rest=False)
    one = time_experiments(data, rate_hz=50.0)[0]
    assert one.inputs.shape[1] == 3000 - 2 * 32
    rest = time_experiments(random_records(at_rest=True), rate_hz=50.0)[0]
    assert rest.inputs.shape[1] == 3000 - 32


def tones(lines, size, excited_hz=None, periods=2):
    """Records whose force has these spectral lines alone, (number, amplitude), at one line a hertz."""
    at = np.arange(size * periods) / size
    force = np.sum([size_of * np.cos(2.0 * np.pi * number * at) for number, size_of in lines], axis=0)
    return TimeRecords(
        channels=(FORCE, DRIVE),
        sample_rate_hz=float(size),
        records=(TimeRecord(samples=np.array([force, 0.5 * force]), name="tones"),),
        period_samples=size,
        excited_hz=excited_hz,
    )


@pytest.mark.parametrize(
    ("size", "excited_hz", "wanted"),
    [
        (64, None, [3, 7, 12, 30, 31]),
        (64, (7.0, 30.0), [7, 12, 30]),  # lines at the ends belong to the band
        (64, (7.1, 29.9), [12]),
        (64, (6.0, 20.0), [7, 12]),
        (63, None, [3, 7, 12, 30, 31]),  # an odd period has its highest line below half the rate
    ],
)
def test_spectra_are_those_from_the_first_excited_line_of_the_band_to_the_last(size, excited_hz, wanted):
    given = [(3, 1.0), (7, 0.2), (12, 1.0), (30, 0.5), (31, 0.7)]
    found = time_spectra(tones(given, size, excited_hz))
    np.testing.assert_allclose(found.frequency_hz, np.arange(wanted[0], wanted[-1] + 1))
    np.testing.assert_array_equal(found.frequency_hz[found.excited], wanted)
    assert found.spectra.shape == (1, 2, 2, wanted[-1] - wanted[0] + 1)
    amplitudes = [dict(given)[number] for number in wanted]
    np.testing.assert_allclose(found.spectra[0, :, 0, found.excited].T, [amplitudes, amplitudes], rtol=1e-9)
    np.testing.assert_allclose(found.spectra[0, :, 1], 0.5 * found.spectra[0, :, 0], atol=1e-12)


def test_a_line_at_half_the_rate_has_no_phase_and_is_left_out():
    found = time_spectra(tones([(3, 1.0), (31, 1.0), (32, 1.0)], 64))
    np.testing.assert_array_equal(found.frequency_hz[found.excited], [3.0, 31.0])


def test_a_band_without_power_is_refused_with_its_ends():
    with refused(IdentificationError, "channel-force-has-no-power-at"):
        time_spectra(tones([(3, 0.0)], 64, (13.0, 20.0)))
