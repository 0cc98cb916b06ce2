"""The fit of A, B, C and D against systems that are known, and its derivatives against differences."""

import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix, IdentificationError, StateSpace, fit_state_space, subspace
from identification.linear.state_space_fit import response_jacobian, spectral_radius
from tests.refused import refused

RATE_HZ = 1000.0


def system(order: int, outputs: int, inputs: int, seed: int) -> StateSpace:
    random = np.random.default_rng(seed)
    a = random.normal(size=(order, order))
    a *= 0.95 / spectral_radius(a)
    b, c = random.normal(size=(order, inputs)), random.normal(size=(outputs, order))
    return StateSpace(a, b, c, random.normal(size=(outputs, inputs)))


def responses_of(model: StateSpace, frequency_hz: np.ndarray, noise: float = 0.0) -> FrequencyResponseMatrix:
    """Responses with noise that is correlated between the paths and known."""
    value = model.response(np.exp(2j * np.pi * frequency_hz / RATE_HZ))
    outputs, inputs = value.shape[1:]
    random, paths = np.random.default_rng(5), outputs * inputs
    mixing = noise * (np.eye(paths) + 0.5 * random.normal(size=(paths, paths)))
    white = random.normal(size=(2, frequency_hz.size, paths)) / np.sqrt(2)
    value = value + ((white[0] + 1j * white[1]) @ mixing.T).reshape(value.shape)
    return FrequencyResponseMatrix(
        outputs=tuple(Channel(f"y{i}", "response", "m/s2") for i in range(outputs)),
        inputs=tuple(Channel(f"u{i}", "force", "N") for i in range(inputs)),
        frequency_hz=frequency_hz,
        value=value,
        noise_covariance=np.broadcast_to(mixing @ mixing.T, (frequency_hz.size, paths, paths)) if noise else None,
    )


def disturbed(model: StateSpace, part: float) -> StateSpace:
    random = np.random.default_rng(9)
    return StateSpace(*(p * (1.0 + part * random.normal(size=p.shape)) for p in model))


@pytest.mark.parametrize(("order", "outputs", "inputs"), [(4, 1, 1), (4, 4, 1), (3, 2, 2)])
def test_derivatives_are_those_of_finite_differences(order: int, outputs: int, inputs: int) -> None:
    model, z = system(order, outputs, inputs, 3), np.exp(1j * np.linspace(0.1, 3.0, 7))
    found = response_jacobian(model, z)
    column = 0
    for index, part in enumerate(model):
        for entry in np.ndindex(part.shape):
            values = []
            for step in (1e-6, -1e-6):
                moved = [np.array(p) for p in model]
                moved[index][entry] += step
                values.append(StateSpace(*moved).response(z))
            difference = (values[0] - values[1]) / 2e-6
            assert np.max(np.abs(found[..., column] - difference)) < 1e-7 * max(1.0, np.max(np.abs(difference)))
            column += 1
    assert column == found.shape[-1]


@pytest.mark.parametrize(("order", "outputs", "inputs"), [(2, 1, 1), (4, 4, 1), (4, 2, 2)])
def test_a_known_system_is_found_to_rounding(order: int, outputs: int, inputs: int) -> None:
    exact = system(order, outputs, inputs, 1)
    found = fit_state_space(
        responses_of(exact, np.arange(2.0, 499.0, 2.0)), disturbed(exact, 0.01), sample_rate_hz=RATE_HZ
    )
    between = np.exp(2j * np.pi * np.linspace(3.3, 497.7, 60) / RATE_HZ)
    np.testing.assert_allclose(found.model.response(between), exact.response(between), rtol=1e-9, atol=1e-9)
    assert found.cost[0] > 1e-6
    assert found.cost[-1] < 1e-20
    assert found.weighting == "relative"


def test_under_noise_the_misfit_is_what_the_covariance_lets_expect() -> None:
    exact = system(4, 2, 2, 6)
    responses = responses_of(exact, np.arange(1.0, 500.0, 1.0), 0.03)
    found = fit_state_space(responses, subspace(responses, 4, sample_rate_hz=RATE_HZ), sample_rate_hz=RATE_HZ)
    assert found.converged
    assert found.weighting == "noise"
    # 1996 complex values: the misfit scatters by 1 / sqrt(2 * 1996) = 1.6 %.
    assert found.residual == pytest.approx(1.0, abs=0.05)
    assert np.all(np.diff(found.cost) <= 0.0)


def test_the_fit_is_nearer_to_the_truth_than_its_start() -> None:
    exact = system(4, 2, 1, 6)
    z = np.exp(2j * np.pi * np.linspace(3.3, 497.7, 200) / RATE_HZ)
    responses = responses_of(exact, np.arange(1.0, 500.0, 2.0), 0.1)
    start = subspace(responses, 4, sample_rate_hz=RATE_HZ)
    found = fit_state_space(responses, start, sample_rate_hz=RATE_HZ).model
    errors = [np.sqrt(np.mean(np.abs(m.response(z) - exact.response(z)) ** 2)) for m in (start, found)]
    assert errors[1] < 0.8 * errors[0]


def test_no_iterate_is_unstable_even_where_the_responses_are() -> None:
    stable = system(2, 1, 1, 2)
    unstable = StateSpace(stable.a * 1.02 / spectral_radius(stable.a), *stable[1:])
    found = fit_state_space(responses_of(unstable, np.arange(2.0, 499.0, 2.0)), stable, sample_rate_hz=RATE_HZ)
    assert spectral_radius(found.model.a) < 1.0
    assert found.cost[-1] < found.cost[0]


def test_what_cannot_be_is_named() -> None:
    exact = system(4, 2, 1, 0)
    responses = responses_of(exact, np.arange(1.0, 20.0, 1.0))
    with refused(IdentificationError, "has-an-eigenvalue-of-magnitude", field="start", allowed="below 1 (stable)"):
        fit_state_space(responses, StateSpace(2.0 * exact.a, *exact[1:]), sample_rate_hz=RATE_HZ)
    with refused(IdentificationError, "has-shape", field="start", allowed="(4, 1)"):
        fit_state_space(responses, StateSpace(exact.a, np.ones((4, 2)), *exact[2:]), sample_rate_hz=RATE_HZ)
    with refused(IdentificationError, field="sample_rate_hz", value=38.0, allowed="more than twice 19 Hz"):
        fit_state_space(responses, exact, sample_rate_hz=38.0)
    with refused(IdentificationError, "lines-are-too-few-for-the", field="frequency_hz", allowed="at least 4"):
        fit_state_space(responses.select(highest_hz=3.0), exact, sample_rate_hz=RATE_HZ)
