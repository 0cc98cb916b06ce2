"""The best linear approximation of experiments: against systems that are known, and what cannot be used."""

from dataclasses import replace

import numpy as np
import pytest

from identification import IdentificationError, best_linear_responses
from tests.identification.models.pnlss.multisines import PERIOD, RATE_HZ, linear_model, measured, multisine, oscillator
from tests.refused import refused

SISO = linear_model(oscillator())


def test_a_linear_system_has_its_own_response_at_the_excited_lines_alone() -> None:
    experiments = [measured(SISO, multisine(seed, band_hz=(20.0, 200.0))) for seed in range(2)]
    found = best_linear_responses(experiments)
    assert found.frequency_hz[0] == pytest.approx(26 * RATE_HZ / PERIOD)
    assert found.frequency_hz[-1] == pytest.approx(200.0)
    exact = oscillator().response(np.exp(2j * np.pi * found.frequency_hz / RATE_HZ))
    np.testing.assert_allclose(found.value, exact, rtol=1e-8)
    assert found.inputs[0].name == "voltage0"
    assert found.estimator == "H1"
    part = best_linear_responses(experiments, band_hz=(50.0, 75.0))
    assert part.frequency_hz[0] == pytest.approx(50.0)
    assert part.frequency_hz[-1] == pytest.approx(75.0)


def test_two_inputs_and_four_outputs_of_two_realisations() -> None:
    matrices = oscillator(inputs=2, outputs=4)
    model = linear_model(matrices)
    found = best_linear_responses([measured(model, multisine([7, seed], inputs=2)) for seed in range(3)])
    exact = matrices.response(np.exp(2j * np.pi * found.frequency_hz / RATE_HZ))
    np.testing.assert_allclose(found.value, exact, atol=1e-7)
    assert "last 1 of 3 realisations left out: blocks are of 2" in found.notes
    assert "too few realisations for a covariance with nonlinear distortion" in found.notes


def test_levels_count_with_their_power_and_weight() -> None:
    strong, gain = linear_model(replace_gain(1.0)), linear_model(replace_gain(3.0))
    period = multisine(1)
    mixed = [measured(strong, period), measured(gain, 0.5 * period).weighted(8.0)]
    found = best_linear_responses(mixed)
    exact = oscillator().response(np.exp(2j * np.pi * found.frequency_hz / RATE_HZ))
    # Powers 1 and 0.25 with weights 1 and 8: gains 1 and 3 in shares of 1 to 2.
    np.testing.assert_allclose(found.value, exact * (1.0 + 2.0 * 3.0) / 3.0, rtol=1e-7)


def replace_gain(gain: float):  # type: ignore[no-untyped-def]
    plain = oscillator()
    return plain._replace(c=gain * plain.c, d=gain * plain.d)


def test_covariances_are_the_scatter_of_repeated_tests() -> None:
    values, noise, total = [], [], []
    for repeat in range(40):
        experiments = [measured(SISO, multisine(r), periods=3, noise=0.05, seed=100 * repeat + r) for r in range(4)]
        found = best_linear_responses(experiments)
        values.append(found.value[:, 0, 0])
        noise.append(found.noise_std[:, 0, 0] ** 2)
        total.append(found.total_std[:, 0, 0] ** 2)
    scatter = np.mean(np.var(values, axis=0, ddof=1))
    assert np.mean(noise) == pytest.approx(scatter, rel=0.05)
    assert np.mean(total) == pytest.approx(scatter, rel=0.05)


def test_one_realisation_is_enough_and_its_want_is_noted() -> None:
    found = best_linear_responses([measured(SISO, multisine(0), periods=2, noise=0.01)])
    assert found.total_covariance is None
    assert found.noise_covariance is not None
    assert "too few realisations for a covariance with nonlinear distortion" in found.notes


def test_what_is_not_periodic_takes_no_part() -> None:
    periodic = measured(SISO, multisine(0))
    sweep = replace(periodic, inputs=2.0 * periodic.inputs, counted_from=5, period_samples=0)
    np.testing.assert_array_equal(
        best_linear_responses([sweep, periodic]).value, best_linear_responses([periodic]).value
    )
    with refused(IdentificationError, "none-is-periodic-or-give-linear", field="experiments"):
        best_linear_responses([sweep])


def test_other_periods_are_left_out_and_counted() -> None:
    usual = [measured(SISO, multisine(seed)) for seed in range(2)]
    found = best_linear_responses([measured(SISO, multisine(5, samples=512), settling=8), *usual])
    np.testing.assert_array_equal(found.value, best_linear_responses(usual).value)
    assert "periodic experiments left out: 1 of other periods than 1024 samples" in found.notes


def test_periods_that_do_not_repeat_are_refused_by_name() -> None:
    good = measured(SISO, multisine(0), periods=2, name="realisation 1")
    drifting = np.array(good.outputs)
    drifting[:, 2 * PERIOD :] = np.roll(drifting[:, 2 * PERIOD :], 300)
    with refused(IdentificationError, "experiment-realisation-channel-periods-a"):
        best_linear_responses([replace(good, outputs=drifting)])
    with refused(IdentificationError, "channel-voltage-periods-and-of-samples"):
        best_linear_responses([replace(good, period_samples=1000, counted_from=3 * PERIOD - 2000)])
    other = np.array(good.inputs)
    other[:, :PERIOD] = multisine(9)
    with refused(IdentificationError, "the-samples-before-sample-experiment-per"):
        best_linear_responses([replace(good, inputs=other)])


def test_a_transient_that_decays_before_counting_begins_is_no_offence() -> None:
    good = measured(SISO, multisine(0))
    assert np.max(np.abs(measured(SISO, multisine(0), settling=1).outputs[:, :200] - good.outputs[:, :200])) > 0.1
    best_linear_responses([measured(SISO, multisine(0), settling=1)])


def test_what_cannot_be_is_named() -> None:
    model = linear_model(oscillator(inputs=2))
    with refused(
        IdentificationError,
        "periodic-for-inputs",
        field="experiments",
        allowed="one for each at least, with other phases at every input",
    ):
        best_linear_responses([measured(model, multisine(0, inputs=2))])
    same = [measured(model, multisine(0, inputs=2)) for _ in range(2)]
    with refused(IdentificationError, "does-not-move-the-inputs-independently-2", field="inputs"):
        best_linear_responses(same)
    good = measured(SISO, multisine(0))
    with refused(IdentificationError, "input-is-zero-at-all-lines", field="inputs"):
        best_linear_responses([replace(good, inputs=np.zeros_like(good.inputs))])
    with refused(IdentificationError, "no-line-in", field="band_hz"):
        best_linear_responses([good], band_hz=(60.2, 60.8))
    with refused(IdentificationError, field="band_hz"):
        best_linear_responses([good], band_hz=(60.0, 50.0))
