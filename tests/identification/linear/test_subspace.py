import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix, IdentificationError, StateSpace, subspace
from tests.refused import refused


def system(order: int, outputs: int, inputs: int, seed: int) -> StateSpace:
    random = np.random.default_rng(seed)
    a = random.normal(size=(order, order))
    a *= 0.95 / np.max(np.abs(np.linalg.eigvals(a)))
    b, c = random.normal(size=(order, inputs)), random.normal(size=(outputs, order))
    return StateSpace(a, b, c, random.normal(size=(outputs, inputs)))


def responses_of(model: StateSpace, frequency_hz: np.ndarray, noise: float = 0.0) -> FrequencyResponseMatrix:
    value = model.response(np.exp(2j * np.pi * frequency_hz / 1000.0))
    random = np.random.default_rng(5)
    value = value + noise * (random.normal(size=value.shape) + 1j * random.normal(size=value.shape)) / np.sqrt(2)
    outputs, inputs = value.shape[1:]
    covariance = np.broadcast_to(noise**2 * np.eye(outputs * inputs), (frequency_hz.size, *(outputs * inputs,) * 2))
    return FrequencyResponseMatrix(
        outputs=tuple(Channel(f"y{i}", "response", "m/s2") for i in range(outputs)),
        inputs=tuple(Channel(f"u{i}", "force", "N") for i in range(inputs)),
        frequency_hz=frequency_hz,
        value=value,
        noise_covariance=covariance if noise else None,
    )


@pytest.mark.parametrize(
    ("order", "outputs", "inputs", "seed"), [(4, 1, 1, 0), (5, 2, 3, 1), (6, 3, 2, 2), (8, 4, 1, 3)]
)
def test_a_random_stable_system_is_recovered_exactly(order: int, outputs: int, inputs: int, seed: int) -> None:
    exact = system(order, outputs, inputs, seed)
    frequency = np.arange(1.0, 500.0, 2.0)
    model = subspace(responses_of(exact, frequency), order, sample_rate_hz=1000.0)
    between = np.exp(2j * np.pi * np.linspace(3.3, 497.7, 60) / 1000.0)
    np.testing.assert_allclose(model.response(between), exact.response(between), rtol=1e-8, atol=1e-8)
    expected, found = (np.sort_complex(np.linalg.eigvals(m.a)) for m in (exact, model))
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_lines_of_a_band_suffice() -> None:
    exact = system(4, 2, 1, 4)
    model = subspace(responses_of(exact, np.arange(60.0, 300.0, 1.0)), 4, sample_rate_hz=1000.0)
    z = np.exp(2j * np.pi * np.linspace(60.5, 299.5, 50) / 1000.0)
    np.testing.assert_allclose(model.response(z), exact.response(z), rtol=1e-8, atol=1e-8)


def test_noise_in_the_responses_averages_out() -> None:
    exact, z = system(4, 2, 2, 6), np.exp(2j * np.pi * np.linspace(3.3, 497.7, 60) / 1000.0)
    errors = []
    for spacing in (8.0, 0.5):
        model = subspace(responses_of(exact, np.arange(1.0, 500.0, spacing), 0.05), 4, sample_rate_hz=1000.0)
        errors.append(np.sqrt(np.mean(np.abs(model.response(z) - exact.response(z)) ** 2)))
    assert errors[1] < 0.4 * errors[0]  # sixteen times the lines: a fourth
    assert errors[1] < 0.02


def test_what_cannot_be_is_named() -> None:
    responses = responses_of(system(4, 2, 1, 0), np.arange(1.0, 20.0, 1.0))
    with refused(IdentificationError, field="order", value=0, allowed="1 and above"):
        subspace(responses, 0, sample_rate_hz=1000.0)
    with refused(IdentificationError, field="sample_rate_hz", value=38.0, allowed="more than twice 19 Hz"):
        subspace(responses, 4, sample_rate_hz=38.0)
    with refused(IdentificationError, "too-few-for-order", field="block_rows", value=2):
        subspace(responses, 4, sample_rate_hz=1000.0, block_rows=2)
    with refused(IdentificationError, "lines-are-too-few-for-block-2", field="frequency_hz"):
        subspace(responses, 20, sample_rate_hz=1000.0)


def test_a_response_at_many_points_is_that_at_few() -> None:
    random = np.random.default_rng(5)
    a = 0.3 * random.normal(size=(6, 6))
    a[4:, 4:] = np.eye(2, k=-1)  # delays, whose eigenvectors are parallel
    model = StateSpace(a, random.normal(size=(6, 2)), random.normal(size=(3, 6)), random.normal(size=(3, 2)))
    z = np.exp(1j * np.linspace(0.0, 3.0, 6000))
    few = np.concatenate([model.response(part) for part in np.array_split(z, 4)])
    assert np.max(np.abs(model.response(z) - few)) < 1e-12 * np.max(np.abs(few))
