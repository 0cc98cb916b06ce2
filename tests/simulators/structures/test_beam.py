import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from simulators.structures.beam import BeamModes, Boundary, Lump, Quantity, Spring, beam_modes, solve_modes

LENGTH_M, STIFFNESS, MASS = 0.55, 184.0, 1.3
CLAMPED_FREE = (1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349)
FREE_FREE = (4.7300407449, 7.8532046241, 10.9956078380)


def beam(
    n_element: int = 40,
    boundary: Boundary = "clamped-free",
    lumps: tuple[Lump, ...] = (),
    n_mode: int = 4,
    springs: tuple[Spring, ...] = (),
) -> BeamModes:
    return beam_modes(
        length_m=LENGTH_M,
        bending_stiffness_n_m2=STIFFNESS,
        mass_per_length_kg_m=MASS,
        n_element=n_element,
        n_mode=n_mode,
        boundary=boundary,
        lumps=lumps,
        springs=springs,
    )


def omega_rad_s(beta_l: tuple[float, ...]) -> np.ndarray:
    return np.array(beta_l) ** 2 / LENGTH_M**2 * np.sqrt(STIFFNESS / MASS)


def second_mode(x: np.ndarray, derivative: int) -> np.ndarray:
    """Closed form of the cantilever's second mode, of unit modal mass, positive at the tip."""
    beta = CLAMPED_FREE[1] / LENGTH_M
    end = CLAMPED_FREE[1]
    sigma = (np.cosh(end) + np.cos(end)) / (np.sinh(end) + np.sin(end))
    turn = 1.0 if derivative == 0 else -1.0
    shape = np.cosh(beta * x) - turn * np.cos(beta * x) - sigma * (np.sinh(beta * x) - turn * np.sin(beta * x))
    return -(beta**derivative) * shape / np.sqrt(MASS * LENGTH_M)


def largest_shape_error(n_element: int, quantity: Quantity) -> float:
    positions = np.linspace(0.0, LENGTH_M, 201)
    modes = beam(n_element)
    shape = np.array([modes.shape(x, quantity)[1] for x in positions]) * np.sign(modes.shape(LENGTH_M)[1])
    return float(np.max(np.abs(shape - second_mode(positions, 0 if quantity == "deflection" else 2))))


def test_cantilever_has_the_frequencies_of_the_closed_form() -> None:
    assert beam(80).omega_rad_s == pytest.approx(omega_rad_s(CLAMPED_FREE), rel=1e-6)


def test_free_beam_has_two_rigid_body_modes_and_the_frequencies_of_the_closed_form() -> None:
    modes = beam(80, "free-free", n_mode=5)
    assert np.all(modes.omega_rad_s[:2] == 0.0)
    assert modes.omega_rad_s[2:] == pytest.approx(omega_rad_s(FREE_FREE), rel=1e-6)


def test_frequencies_converge_with_the_fourth_power_of_the_element_length() -> None:
    exact = omega_rad_s(CLAMPED_FREE)
    coarse, fine = (beam(n).omega_rad_s / exact - 1.0 for n in (8, 16))
    assert np.all(coarse[1:] > 0.0)
    assert np.log2(coarse[1:] / fine[1:]) == pytest.approx(np.full(3, 4.0), abs=0.15)


@pytest.mark.parametrize(("quantity", "order"), [("deflection", 4.0), ("curvature", 2.0)])
def test_shape_converges_to_the_closed_form_all_along_the_beam(quantity: Quantity, order: float) -> None:
    coarse, fine = largest_shape_error(16, quantity), largest_shape_error(32, quantity)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.12)


def test_tip_of_a_uniform_cantilever_moves_twice_its_root_mean_square() -> None:
    # Closed form: a mode normalised to unit mass has the tip deflection 2 / sqrt(m).
    assert np.abs(beam(80).shape(LENGTH_M)) == pytest.approx(np.full(4, 2.0 / np.sqrt(MASS * LENGTH_M)), rel=1e-5)


def test_mass_at_the_tip_lowers_the_frequency_as_in_the_closed_form() -> None:
    ratio = 0.3

    def characteristic(x: float) -> float:
        return 1 + np.cos(x) * np.cosh(x) + ratio * x * (np.cos(x) * np.sinh(x) - np.sin(x) * np.cosh(x))

    beta_l = (brentq(characteristic, 1.0, 1.8751), brentq(characteristic, 3.5, 4.6941))
    modes = beam(80, lumps=(Lump(LENGTH_M, ratio * MASS * LENGTH_M),))
    assert modes.omega_rad_s[:2] == pytest.approx(omega_rad_s(beta_l), rel=1e-6)


def test_modes_are_mass_normalised_and_orthogonal_with_lumped_masses_anywhere() -> None:
    lumps = (Lump(0.2111, 0.05, 1e-4), Lump(0.55, 0.1))
    modes = beam(40, lumps=lumps)
    nodes, weights = np.polynomial.legendre.leggauss(5)
    size = LENGTH_M / 40
    positions = (np.arange(40)[:, None] + (nodes + 1) / 2) * size
    shapes = np.array([modes.shape(x) for x in positions.ravel()])
    mass = MASS * size / 2 * (shapes.T * np.tile(weights, 40)) @ shapes
    for x, kg, inertia in lumps:
        deflection, slope = modes.shape(x), modes.shape(x, "slope")
        mass += kg * np.outer(deflection, deflection) + inertia * np.outer(slope, slope)
    assert mass == pytest.approx(np.eye(4), abs=1e-9)


@pytest.mark.parametrize("position_m", [0.003, 0.2, 0.3333, 0.549])
def test_slope_and_curvature_are_the_derivatives_of_the_deflection(position_m: float) -> None:
    modes, step = beam(), 1e-5
    left, here, right = (modes.shape(position_m + k * step) for k in (-1, 0, 1))
    slopes = modes.shape(position_m + step, "slope") - modes.shape(position_m - step, "slope")
    assert modes.shape(position_m, "slope") == pytest.approx((right - left) / (2 * step), rel=1e-6, abs=1e-5)
    assert modes.shape(position_m, "curvature") == pytest.approx(slopes / (2 * step), rel=1e-6, abs=1e-4)
    assert np.all(np.isfinite(here))


def test_modes_are_those_of_the_general_eigenvalue_problem() -> None:
    random = np.random.default_rng(4)
    factors = random.normal(size=(2, 12, 12)) + 4.0 * np.eye(12)
    stiffness, mass = (factor @ factor.T for factor in factors)
    squared, vectors = solve_modes(stiffness, mass, 5, 1.0)
    expected, shapes = eigh(stiffness, mass)
    np.testing.assert_allclose(squared, expected[:5], rtol=1e-10)
    np.testing.assert_allclose(np.abs(shapes[:, :5].T @ mass @ vectors), np.eye(5), atol=1e-9)
