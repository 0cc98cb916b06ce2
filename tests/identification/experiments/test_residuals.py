"""A residual is held against the noise: a right model has a ratio of 1, a wrong one that of the closed form."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, Experiment, IdentificationError
from identification.experiments.noise import mean_covariance
from identification.experiments.residuals import (
    ResidualAndNoise,
    log_likelihood_ratio,
    residual_and_noise,
    residual_over_noise,
    unsettled,
    unsettled_share,
)
from tests.refused import refused

SIZE, PERIODS, RATE_HZ = 1000, 6, 500.0
LINES = np.arange(20, 121)
"""Excited lines: 10 to 60 Hz."""
FORCE, DRIVE, TIP = (
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s2"),
    Channel("tip", "response", "m/s2"),
)
HZ = np.fft.rfftfreq(SIZE, 1.0 / RATE_HZ)
RESPONSE = np.array([HZ**2 / (25.0**2 - HZ**2 + 2j * 0.02 * 25.0 * HZ) * gain for gain in (1.0, -2.0)])


def _periods(random, count=PERIODS, shaken=0.0, force=0.0, outputs=0.0):
    """Force and outputs [3, periods, SIZE]: noise of the shaker, which the structure follows, and of each sensor (RMS)."""
    lines = np.zeros((count, SIZE // 2 + 1), complex)
    lines[:, LINES] = SIZE * np.exp(2j * np.pi * np.random.default_rng(1).random(LINES.size))
    lines += np.fft.rfft(shaken * random.standard_normal((count, SIZE)))
    both = np.fft.irfft(np.array([lines, *(RESPONSE[:, None] * lines)]), SIZE)
    sensors = np.array([force, outputs, outputs])[:, None, None]
    return both + sensors * random.standard_normal(both.shape)


def _experiment(periods) -> Experiment:
    whole = periods.reshape(3, -1)
    of_periods = Experiment(
        inputs=whole[:1],
        outputs=whole[1:],
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=(DRIVE, TIP),
        period_samples=SIZE,
        excited_hz=(10.0, 60.0),
    )
    return of_periods.averaged(transient_samples=0)


def _simulated(experiment, gain=1.0):
    return gain * np.fft.irfft(RESPONSE * np.fft.rfft(experiment.counted_inputs), SIZE)


@pytest.mark.parametrize("noise", [{"outputs": 0.05}, {"force": 0.01}, {"shaken": 0.2, "force": 0.01, "outputs": 0.05}])
def test_a_right_model_has_a_ratio_of_one_whatever_the_noise_is_in(noise):
    random = np.random.default_rng(5)
    ratios = [
        residual_over_noise(one, _simulated(one)) for one in (_experiment(_periods(random, **noise)) for _ in range(40))
    ]
    squares = np.mean(np.square(ratios), axis=0)
    # the lines about the resonance, where noise of the force is large, are few: 40 records of some ten lines
    np.testing.assert_allclose(squares, 1.0, atol=0.25)
    assert np.max(ratios) < 2.0


def test_a_wrong_gain_gives_what_it_misses_over_the_noise():
    random = np.random.default_rng(6)
    one = _experiment(_periods(random, outputs=0.05))
    lines = np.sum(
        np.abs(RESPONSE[:, LINES]) ** 2 * 4.0, axis=1
    )  # power of the outputs: amplitudes of 2 times the response
    noise = LINES.size * 4.0 * 0.05**2 / (SIZE * PERIODS)
    expected = 0.01 * np.sqrt(lines / noise)
    assert np.all(expected > 5.0)
    np.testing.assert_allclose(residual_over_noise(one, _simulated(one, 1.01)), expected, rtol=0.15)


def _likelihood_ratio(smaller, larger, records):
    """Log-likelihood ratio of models with these gains, on all records."""
    parts = [
        ResidualAndNoise(
            *map(np.array, zip(*(residual_and_noise(one, _simulated(one, gain)) for one in records), strict=True))
        )
        for gain in (smaller, larger)
    ]
    return log_likelihood_ratio(*parts)


def test_the_likelihood_ratio_is_the_power_of_what_a_model_misses_over_the_noise_and_adds_up_over_records():
    """Of white noise in all lines; scatter known from 6 periods makes lines fewer by 1 + 1/5, the mean square of chi-square."""
    random = np.random.default_rng(6)
    records = [_experiment(_periods(random, outputs=0.05)) for _ in range(3)]
    missed = 0.01**2 * np.sum(np.abs(RESPONSE[:, LINES]) ** 2 * 4.0, axis=1) / (4.0 * 0.05**2 / (SIZE * PERIODS))
    expected = 3.0 * np.mean(missed) / 1.2
    assert expected > 100.0
    assert _likelihood_ratio(1.01, 1.0, records) == pytest.approx(expected, rel=0.1)
    assert _likelihood_ratio(1.0, 1.0, records) == 0.0


def test_noise_alone_rarely_makes_another_model_twenty_times_more_likely():
    """At the difference of the models at which it does so most often, ``2 (1 - Phi(sqrt(2 log 20)))`` or less of the time."""
    random = np.random.default_rng(8)
    missed = np.sum(np.abs(RESPONSE[:, LINES]) ** 2 * 4.0, axis=1).mean() / (4.0 * 0.05**2 / (SIZE * PERIODS))
    gain = 1.0 + np.sqrt(np.log(20.0) / missed)
    found = [_likelihood_ratio(1.0, gain, [_experiment(_periods(random, outputs=0.05))]) for _ in range(60)]
    assert np.count_nonzero(np.array(found) > np.log(20.0)) <= 3
    assert np.mean(found) < 0.0  # the smaller model is right


def test_where_no_record_shows_the_noise_there_is_no_likelihood_ratio():
    one = _experiment(_periods(np.random.default_rng(7), outputs=0.05))
    unknown = replace(one, noise_covariance=None)
    assert np.isnan(_likelihood_ratio(1.01, 1.0, [unknown]))
    assert _likelihood_ratio(1.01, 1.0, [unknown, one]) == _likelihood_ratio(1.01, 1.0, [one])


def test_errors_of_the_steps_count_as_noise():
    one = _experiment(_periods(np.random.default_rng(6), outputs=0.05))
    wrong = _simulated(one, 1.01)
    of_steps = wrong - _simulated(one)
    assert np.all(residual_over_noise(one, wrong) > 5.0)
    assert np.all(residual_over_noise(one, wrong, of_steps) < 1.1)


@pytest.mark.parametrize("case", ["one period", "not periodic", "two inputs", "few lines", "unbounded"])
def test_where_the_noise_is_unknown_there_is_no_ratio(case):
    random = np.random.default_rng(7)
    one = _experiment(_periods(random, count=1 if case == "one period" else PERIODS, outputs=0.05))
    simulated = _simulated(one)
    match case:
        case "not periodic":
            one = replace(one, period_samples=0)
        case "two inputs":
            one = replace(
                one,
                inputs=np.vstack([one.inputs, one.inputs]),
                input_channels=(FORCE, Channel("second", "force", "N")),
                noise_covariance=np.zeros((SIZE // 2 - 1, 4, 4), complex),
            )
        case "few lines":
            one = replace(one, excited_hz=(10.0, 18.0))
        case "unbounded":
            simulated = np.full_like(simulated, np.nan)
    assert np.isnan(residual_over_noise(one, simulated)).all()


def test_a_constant_input_has_no_noise_and_leaves_the_ratio():
    one = _experiment(_periods(np.random.default_rng(8), outputs=0.05))
    simulated = _simulated(one)
    found = residual_over_noise(one.with_constant_input(), simulated)
    np.testing.assert_allclose(found, residual_over_noise(one, simulated), rtol=1e-12)


def test_the_covariance_of_the_mean_is_that_of_white_noise():
    """Standard deviation of a line's amplitude ``s sqrt(4 / (N P))``; two channels with the same noise are fully coherent."""
    noise = 0.3 * np.random.default_rng(9).standard_normal((1, PERIODS, SIZE))
    found = mean_covariance(np.vstack([noise, 2.0 * noise]), SIZE)
    assert found.shape == (SIZE // 2 - 1, 2, 2)
    assert np.mean(found[:, 0, 0].real) == pytest.approx(4.0 * 0.3**2 / (SIZE * PERIODS), rel=0.1)
    np.testing.assert_allclose(found[:, 0, 1], 2.0 * found[:, 0, 0], rtol=1e-12)
    assert mean_covariance(noise[:, :1], SIZE) is None


def test_a_covariance_of_another_shape_is_refused():
    one = _experiment(_periods(np.random.default_rng(8)))
    with refused(IdentificationError, field="noise_covariance", allowed="499, 3, 3"):
        replace(one, noise_covariance=np.zeros((3, 3), complex))


def test_periods_that_differ_too_much_are_no_settled_vibration():
    """Periods of the outputs that change in size: their mean is known within the standard error of the factors."""
    periods = _periods(np.random.default_rng(3))
    factors = np.array([1.0, 1.3, 0.6, 1.1, 0.9, 1.2])
    changing = _experiment(periods * np.array([np.ones(PERIODS), factors, factors])[:, :, None])
    known = np.std(factors, ddof=1) / np.sqrt(PERIODS) / np.mean(factors)
    assert unsettled_share(changing) == pytest.approx(known, rel=1e-6)
    (said,) = unsettled([_experiment(periods), replace(changing, name="loud")])
    assert said.startswith("loud: the mean of its periods is known within")
    assert not unsettled([_experiment(_periods(np.random.default_rng(4), shaken=0.2, force=0.01, outputs=0.05))])
    assert np.isnan(unsettled_share(replace(changing, noise_covariance=None)))
