from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix, IdentificationError, linear_modes, stabilisation
from identification.linear.errors_in_variables import driven_responses
from tests.identification.linear.structures import (
    CHANNELS,
    DAMPING,
    FORCE,
    FREQUENCY_HZ,
    LINES_HZ,
    SHAPES,
    accelerance,
)
from tests.refused import refused

VOLTAGE = (Channel("voltage", "monitor", "V"),)


def driven(seed: int, force_noise: float, motion_noise: float = 0.05, realisations: int = 5) -> FrequencyResponseMatrix:
    """Force and motions over a voltage: an exciter of 0.5 kg that the structure takes the force from where it resonates."""
    random = np.random.default_rng(seed)
    exact = accelerance()
    force = 1.0 / (1.0 + 0.5 * exact[:, :1])
    true = np.hstack([force, exact * force])

    def normal(size: float, outputs: int) -> np.ndarray:
        shape = (realisations, LINES_HZ.size, outputs)
        return size * (random.normal(size=shape) + 1j * random.normal(size=shape)) / np.sqrt(2.0)

    each = true + np.concatenate([normal(force_noise, 1), normal(motion_noise, 2)], axis=2)
    off = each - each.mean(axis=0)
    return FrequencyResponseMatrix(
        outputs=(*FORCE, *CHANNELS),
        inputs=VOLTAGE,
        frequency_hz=LINES_HZ,
        value=each.mean(axis=0)[:, :, None],
        total_covariance=np.einsum("rko,rkp->kop", off, np.conj(off)) / (realisations * (realisations - 1)),
        input_rms=(2.0,),
    )


def test_the_working_responses_have_the_gradient_of_the_likelihood() -> None:
    data = driven_responses(driven(0, 0.3))
    assert data is not None
    model, random = accelerance() * 1.01, np.random.default_rng(1)

    def cost(responses: np.ndarray) -> float:
        misfit = data.value[:, 1:] - responses * data.value[:, :1]
        turn = np.concatenate([-responses[:, :, None], np.broadcast_to(np.eye(2), (len(model), 2, 2))], axis=2)
        matrix = turn @ data.smooth @ np.conj(turn.swapaxes(1, 2))
        return float(np.sum(np.conj(misfit) * np.linalg.solve(matrix, misfit[:, :, None])[:, :, 0]).real)

    working = data.around(model)
    off = working.value[:, :, 0] - model
    for _ in range(3):
        way = model * (random.normal(size=model.shape) + 1j * random.normal(size=model.shape))
        numeric = (cost(model + 1e-6 * way) - cost(model - 1e-6 * way)) / 2e-6
        heavy = np.linalg.solve(working.smooth, off[:, :, None])[:, :, 0]
        assert -2.0 * np.sum(np.conj(way) * heavy).real == pytest.approx(numeric, rel=1e-5)


@pytest.mark.slow
def test_modes_come_out_right_where_the_force_is_below_its_noise() -> None:
    truth = np.concatenate([FREQUENCY_HZ, DAMPING, SHAPES.ravel()])
    pulls, residuals = [], []
    for seed in range(12):
        responses = driven(seed, 0.1)
        modes = linear_modes(responses, modes=list(FREQUENCY_HZ), orders=range(6, 17, 2))
        found = np.concatenate([modes.frequency_hz, modes.damping_ratio, modes.shapes.ravel()])
        assert modes.covariance is not None
        pulls.append((found - truth) / np.sqrt(np.diag(modes.covariance)))
        residuals.append(modes.fit_residual)
    force = 1.0 / np.abs(1.0 + 0.5 * accelerance()[:, 0])
    assert force.min() < 0.5 * 0.1 / np.sqrt(5.0)
    assert np.abs(np.mean(pulls, axis=0)).max() < 3.5 / np.sqrt(12.0)
    assert 0.9 <= np.mean(np.abs(pulls) < 1.96) <= 0.99
    assert np.mean(residuals) == pytest.approx(1.0, abs=0.03)


def test_the_level_is_that_of_the_force_and_the_channels_are_the_motions() -> None:
    responses = driven(3, 0.01, 0.01)
    modes = linear_modes(responses, modes=list(FREQUENCY_HZ), diagram=stabilisation(responses, range(6, 17, 2)))
    force = 1.0 / (1.0 + 0.5 * accelerance()[:, 0])
    assert modes.force_rms_n == pytest.approx(2.0 * np.sqrt(np.mean(np.abs(force) ** 2)), rel=1e-2)
    assert modes.channels == CHANNELS
    np.testing.assert_allclose(modes.accelerance(LINES_HZ), accelerance(), atol=0.05 * np.max(np.abs(accelerance())))
    again = linear_modes(driven(4, 0.01, 0.01), modes=modes)
    np.testing.assert_allclose(again.frequency_hz, FREQUENCY_HZ, rtol=1e-4)


def test_what_has_no_covariance_is_fitted_as_quotients_and_without_a_force_there_is_none() -> None:
    responses = driven(5, 0.0, 0.0)
    modes = linear_modes(replace(responses, total_covariance=None), modes=list(FREQUENCY_HZ))
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ, rtol=1e-6)
    with refused(IdentificationError, "are-voltage-monitor", field="inputs"):
        linear_modes(responses.select(["drive", "tip"]))


def test_a_covariance_of_rounding_or_of_low_rank_makes_no_false_precision() -> None:
    rounding = replace(driven(6, 0.0, 0.0), total_covariance=np.full((LINES_HZ.size, 3, 3), 1e-40))
    assert any("no covariance" in note for note in linear_modes(rounding, modes=list(FREQUENCY_HZ)).notes)
    two = linear_modes(driven(7, 0.05, realisations=2), modes=list(FREQUENCY_HZ), orders=range(6, 17, 2))
    assert np.all(two.frequency_std_hz > 1e-7 * FREQUENCY_HZ)
    assert np.all(np.abs(two.frequency_hz - FREQUENCY_HZ) < 5.0 * two.frequency_std_hz)


def test_an_error_of_every_record_is_a_standard_error_of_what_it_does_to_the_modes() -> None:
    clean = driven(0, 1e-4, 1e-4)
    error = np.zeros(clean.value.shape, np.complex128)
    error[:, 0, 0] = (2e-3 + 3e-3j) * LINES_HZ / LINES_HZ[-1]  # in the force alone
    options = {"modes": list(FREQUENCY_HZ), "orders": range(6, 17, 2)}
    wrong = replace(clean, value=clean.value + error)
    truth, without = linear_modes(clean, **options), linear_modes(wrong, **options)
    modes = linear_modes(wrong, **options, error=error)
    for name in ("frequency", "damping_ratio"):
        value = "frequency_hz" if name == "frequency" else name
        std = "frequency_std_hz" if name == "frequency" else "damping_ratio_std"
        random = getattr(without, std)
        systematic = np.sqrt(getattr(modes, std) ** 2 - random**2)
        np.testing.assert_array_equal(getattr(modes, value), getattr(without, value))  # not corrected
        off = np.abs(getattr(without, value) - getattr(truth, value))
        assert np.max(off / random) > 3.0
        assert np.all(np.abs(systematic - off) < 0.05 * off + 0.5 * random)
