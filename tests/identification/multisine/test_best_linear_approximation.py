import numpy as np
import pytest

from identification import Channel, IdentificationError, MultisineDesign, PeriodicSpectra, best_linear_approximation
from tests.identification.multisine.linear_systems import RATE_HZ, instruments, measured, response_of
from tests.refused import refused

FEW_LINES = MultisineDesign(RATE_HZ, 100, 40.0, 160.0)


def scaled(covariance: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return covariance / (scale[:, :, None] * scale[:, None, :])


@pytest.mark.parametrize(
    ("n_outputs", "n_inputs", "estimator"),
    [(4, 1, "instrument"), (4, 1, "H1"), (4, 1, "H2"), (2, 2, "instrument"), (2, 2, "H1"), (4, 2, "instrument")],
)
def test_a_linear_system_without_noise_returns_its_own_response_exactly(
    n_outputs: int, n_inputs: int, estimator: str
) -> None:
    found = best_linear_approximation(
        measured(n_outputs, n_inputs), estimator=estimator, instruments=instruments(n_inputs)
    )
    expected = response_of(n_outputs, n_inputs, found.frequency_hz)
    assert np.max(np.abs(found.value / expected - 1.0)) < 1e-12
    assert np.max(found.total_std / np.abs(expected)) < 1e-12
    assert found.value.shape[1:] == (n_outputs, n_inputs)
    assert found.estimator == estimator
    assert [c.role for c in found.inputs] == ["force"] * n_inputs


def test_the_voltage_as_input_and_instrument_gives_the_plain_average_over_realisations() -> None:
    spectra = measured(2, 1, noise=0.1, cubic=0.1)
    found = best_linear_approximation(spectra, inputs=("voltage",))
    means = spectra.mean[..., spectra.excited]
    # A flat design weighs all realisations alike.
    np.testing.assert_allclose(found.value[:, :, 0], np.mean(means[:, 2:] / means[:, :1], axis=0).T, rtol=1e-12)
    h1 = best_linear_approximation(spectra, inputs=("voltage",), estimator="H1")
    np.testing.assert_allclose(h1.value, found.value, rtol=1e-12)
    assert found.input_rms == pytest.approx((1.0,))


@pytest.mark.parametrize(
    ("n_outputs", "n_inputs", "estimator"), [(3, 1, "instrument"), (2, 2, "instrument"), (3, 1, "H1")]
)
def test_covariances_are_those_of_many_repeated_measurements(n_outputs: int, n_inputs: int, estimator: str) -> None:
    runs = 250
    for cubic in (0.0, 0.05):
        values, noise, total = [], [], []
        for seed in range(runs):
            spectra = measured(
                n_outputs, n_inputs, noise=0.02, common=0.03, cubic=cubic, blocks=4, seed=seed, design=FEW_LINES
            )
            found = best_linear_approximation(spectra, estimator=estimator, instruments=instruments(n_inputs))
            values.append(found.value.reshape(found.frequency_hz.size, -1))
            noise.append(found.covariance("noise"))
            total.append(found.covariance("total"))
        errors = np.array(values) - np.mean(values, axis=0)
        expected = np.einsum("rkm,rkn->kmn", errors, np.conj(errors)) / (runs - 1)
        size = np.sqrt(np.einsum("kii->ki", expected).real)
        difference = scaled(np.mean(total, axis=0) - expected, size)
        # A correlation found in n runs has a deviation of about 1 / sqrt(n), the estimates' scatter adds its own, and
        # distortion in few lines is neither normal nor circular.
        assert np.sqrt(np.mean(np.abs(difference) ** 2)) < (2.2 if cubic else 1.5) / np.sqrt(runs)
        assert np.mean(np.einsum("kii->ki", difference).real) == pytest.approx(0.0, abs=0.04)
        if cubic == 0.0:
            difference = scaled(np.mean(noise, axis=0) - expected, size)
            assert np.sqrt(np.mean(np.abs(difference) ** 2)) < 1.5 / np.sqrt(runs)
            if n_outputs > 2:  # one force's noise and what is common tie the paths together
                assert np.mean(np.abs(scaled(expected, size)[:, 0, 1:])) > 0.2
            linear = np.mean(noise, axis=0)
        else:
            np.testing.assert_allclose(scaled(np.mean(noise, axis=0) - linear, size), 0.0, atol=0.05)
            assert np.mean(np.einsum("kii->ki", scaled(np.mean(noise, axis=0), size)).real) < 0.5


def test_h1_is_biased_low_by_the_force_s_noise_and_h2_high_by_the_response_s() -> None:
    spectra = measured(1, 1, noise=1.0, blocks=1000, design=FEW_LINES)
    mean = {}
    for estimator in ("instrument", "H1", "H2"):
        found = best_linear_approximation(spectra, estimator=estimator)
        mean[estimator] = (found.value / response_of(1, 1, found.frequency_hz))[:, 0, 0].real
    frequency_hz = FEW_LINES.frequency_hz
    force = 2.0 * np.abs(1 / (1 + 1j * frequency_hz / 90.0)) * FEW_LINES.amplitudes
    noise = 4.0 / FEW_LINES.period_samples / 3  # power of white noise at a line of the mean over three periods
    motion = np.abs(response_of(1, 1, frequency_hz)[:, 0, 0]) * force
    np.testing.assert_allclose(mean["instrument"], 1.0, atol=0.05)
    np.testing.assert_allclose(mean["H1"], force**2 / (force**2 + noise), atol=0.05)
    np.testing.assert_allclose(mean["H2"], 1.0 + noise / motion**2, atol=0.05)
    assert np.min(mean["H1"]) < 0.95
    assert np.max(mean["H2"]) > 1.1


def test_two_shakers_without_orthogonal_signals_still_give_the_exact_response() -> None:
    rng = np.random.default_rng(0)
    spectra = measured(2, 2)
    turned = spectra.spectra * 1.0
    mixing = rng.normal(size=(6, 6)) + 1j * rng.normal(size=(6, 6))  # any linear mixture of experiments obeys Y = H U
    mixed = PeriodicSpectra(
        spectra.channels, spectra.frequency_hz, spectra.excited, np.einsum("rs,spck->rpck", mixing, turned)
    )
    found = best_linear_approximation(mixed, instruments=instruments(2))
    np.testing.assert_allclose(found.value, response_of(2, 2, found.frequency_hz), rtol=1e-10)


def test_what_is_missing_of_the_covariances_is_said_and_refused_where_it_is_asked_for() -> None:
    found = best_linear_approximation(measured(2, 1, noise=0.1, blocks=1, periods=1))
    assert found.noise_covariance is None
    assert found.total_covariance is None
    assert found.notes == (
        "noise covariance unknown: 1 x 1 period only",
        "total covariance unknown: 1 realisation only",
    )
    assert np.all(np.isnan(found.noise_std))
    with refused(IdentificationError, "unknown-measurement-of-two-periods-or", field="noise_covariance"):
        found.covariance("noise")
    few = best_linear_approximation(measured(4, 1, noise=0.1, blocks=3, periods=2))
    assert [note.split(" (")[0] for note in few.notes] == [
        "noise covariance of 4 paths has rank 3",
        "total covariance of 4 paths has rank 2",
    ]
    assert np.linalg.matrix_rank(few.total_covariance[0], hermitian=True, tol=1e-9 * few.total_std[0].max() ** 2) == 2
    assert not best_linear_approximation(measured(2, 1, noise=0.1)).notes


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"estimator": "H3"}, {"field": "estimator", "value": "H3", "allowed": "instrument, H1, H2, Hv"}),
        ({"estimator": "H2"}, {"says": "with-inputs", "field": "estimator", "allowed": "one"}),
        (
            {"instruments": ("voltage0",)},
            {"says": "are-voltage", "field": "instruments", "allowed": "one per input, 2"},
        ),
        ({"outputs": ("a0", "a0")}, {"says": "message", "field": "outputs"}),
        ({"outputs": ()}, {"says": "none-given", "field": "outputs"}),
        ({"inputs": ("thrust",)}, {"says": "no-channel-thrust"}),
    ],
)
def test_channels_and_estimators_that_do_not_fit_are_named(arguments: dict[str, object], message: str) -> None:
    with refused(IdentificationError, **message):
        best_linear_approximation(measured(2, 2), **({"instruments": instruments(2)} | arguments))


def test_experiments_that_cannot_tell_the_inputs_apart_are_refused() -> None:
    spectra = measured(2, 2)
    same = PeriodicSpectra(
        spectra.channels, spectra.frequency_hz, spectra.excited, np.repeat(spectra.spectra[:1], 4, axis=0)
    )
    with refused(
        IdentificationError, "does-not-move-the-inputs-independently", field="instruments 'voltage0', 'voltage1'"
    ):
        best_linear_approximation(same, instruments=instruments(2))
    odd = PeriodicSpectra(spectra.channels, spectra.frequency_hz, spectra.excited, spectra.spectra[:3])
    with refused(IdentificationError, "are-need-multiple-of-the-inputs", field="realisations"):
        best_linear_approximation(odd, instruments=instruments(2))


def test_outputs_that_are_different_motions_are_noted() -> None:
    spectra = measured(2, 1, noise=0.1)
    channels = (*spectra.channels[:3], Channel("a1", "response", "m"))
    mixed = PeriodicSpectra(channels, spectra.frequency_hz, spectra.excited, spectra.spectra)
    found = best_linear_approximation(mixed)
    assert found.notes == (
        "outputs are different motions (a0 acceleration, a1 displacement): their responses do not compare",
    )
    assert not best_linear_approximation(mixed, outputs=("a1",)).notes


def test_an_excited_line_without_power_is_refused() -> None:
    spectra = measured(2, 1)
    silent = spectra.spectra.copy()
    silent[:, :, 1, 7] = 0.0
    dead = PeriodicSpectra(spectra.channels, spectra.frequency_hz, spectra.excited, silent)
    with refused(IdentificationError, "gives-no-input-at-hz-an", field="instrument 'voltage'"):
        best_linear_approximation(dead)
