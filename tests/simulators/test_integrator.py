from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from simulators.plant.compilation import phi_matrices
from simulators.simulation import Simulation
from tests.sharing import made_once, shared_folder
from tests.simulators.references import EquationsOfMotion, ideal

DT_S = 1 / 5000
# A strong transient: from rest, a square wave of voltage near resonance builds up until the magnets move through 0.45 of
# their gap. The error is the largest one of the stinger force at any sample, relative to its peak.
AMPLITUDE_V = {"magnet-beam": 3.5, "magnet-beam-symmetric": 4.2}
HALF_PERIOD = 100
TABLE = {"magnet-beam": {1: 1.6e-4, 2: 2e-5, 4: 2.5e-6}, "magnet-beam-symmetric": {1: 5e-4, 2: 6.5e-5, 4: 8.2e-6}}


def square_wave(specimen: str) -> np.ndarray:
    return AMPLITUDE_V[specimen] * np.repeat(np.resize([1.0, -1.0], 16), HALF_PERIOD)


@pytest.fixture(scope="module", params=sorted(TABLE))
def errors(request: pytest.FixtureRequest) -> tuple[str, dict[int, float], float]:
    specimen = request.param
    voltages = square_wave(specimen)
    equations = EquationsOfMotion(ideal(specimen, friction=()))

    def solve(folder: Path) -> None:
        np.save(folder / "states.npy", equations.solve(voltages, DT_S))

    states = np.load(made_once(shared_folder() / f"states-of-{specimen}", solve) / "states.npy")
    force_n = np.array([equations.stinger_force_n(x) for x in states])
    largest = np.max(np.abs(states[:, :4] @ equations.rows[0])) / equations.elements[0].gap_m
    result = {}
    for substeps in (1, 2, 4, 8):
        run = Simulation(ideal(specimen, friction=(), converter={"substeps": substeps})).run(voltages)
        result[substeps] = float(np.max(np.abs(run.force_n - force_n)) / np.max(np.abs(force_n)))
    return specimen, result, float(largest)


@pytest.mark.slow
def test_transient_is_a_strong_one(errors: tuple[str, dict[int, float], float]) -> None:
    assert errors[2] == pytest.approx(0.45, abs=0.01)


def test_force_error_against_dop853_meets_the_table(errors: tuple[str, dict[int, float], float]) -> None:
    specimen, error, _ = errors
    for substeps, allowed in TABLE[specimen].items():
        assert error[substeps] < allowed


def test_error_falls_with_the_third_power_of_the_step(errors: tuple[str, dict[int, float], float]) -> None:
    _, error, _ = errors
    assert np.log2(error[2] / error[4]) == pytest.approx(3.0, abs=0.3)
    assert np.log2(error[4] / error[8]) == pytest.approx(3.0, abs=0.2)


def test_phi_matrices_are_the_integrals_they_stand_for() -> None:
    random = np.random.default_rng(1)
    dynamics, columns, step = random.normal(size=(5, 5)), random.normal(size=(5, 2)), 0.7
    phi = phi_matrices(dynamics, columns, step)
    held, _ = quad_vec(lambda s: expm((step - s) * dynamics) @ columns, 0.0, step, epsrel=1e-12)
    ramp, _ = quad_vec(lambda s: expm((step - s) * dynamics) @ columns * s / step, 0.0, step, epsrel=1e-12)
    curve, _ = quad_vec(lambda s: expm((step - s) * dynamics) @ columns * (s / step) ** 2, 0.0, step, epsrel=1e-12)
    assert phi.held == pytest.approx(held, rel=1e-10)
    assert phi.ramp == pytest.approx(ramp, rel=1e-10)
    assert phi.curve == pytest.approx(curve, rel=1e-10)


def test_small_elements_of_the_transition_keep_their_digits_as_in_an_exponential_of_longer_numbers() -> None:
    """A mode of 900 Hz over a step of 25 us, whose acceleration is ten million times its displacement."""
    omega = 2.0 * np.pi * 900.0
    dynamics, columns = np.array([[0.0, 1.0], [-(omega**2), -0.02 * omega]]), np.array([[0.0], [3.0]])
    step = 25e-6
    phi = phi_matrices(dynamics, columns, step)
    augmented = step * np.block([[dynamics, columns], [np.zeros((1, 3))]]).astype(np.longdouble)
    exact = term = np.eye(3, dtype=np.longdouble)
    for order in range(1, 60):
        term = term @ augmented / order
        exact = exact + term
    np.testing.assert_allclose(np.hstack([phi.transition, phi.held]), exact[:2].astype(float), rtol=1e-13)
    np.testing.assert_allclose(phi.transition, expm(step * dynamics), rtol=1e-9)


@pytest.mark.parametrize("step", [0.0, 1e-6, 3.0, 400.0])
def test_the_transition_is_the_exponential_over_any_step(step: float) -> None:
    dynamics = np.random.default_rng(2).normal(size=(6, 6)) - 4.0 * np.eye(6)
    transition = phi_matrices(dynamics, np.zeros((6, 1)), step).transition
    np.testing.assert_allclose(transition, expm(step * dynamics), rtol=1e-9, atol=1e-13)


def test_linear_part_is_exact_whatever_the_step() -> None:
    # With hardly any magnet the rig is linear, and a sample with one sub-step is as good as one with eight.
    weak = [{"kind": "magnet-one-sided", "at": "magnet", "strength_n_m4": 1e-30, "gap_m": 0.011}]
    voltages = square_wave("magnet-beam")
    runs = [
        Simulation(ideal(friction=(), elements=weak, converter={"substeps": substeps})).run(voltages)
        for substeps in (1, 8)
    ]
    assert runs[0].force_n == pytest.approx(runs[1].force_n, abs=1e-9 * np.max(np.abs(runs[1].force_n)))
