"""Hystereses of Bouc and Wen: their equation, energy, exact derivatives, and runs of a model that has one."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numba import njit
from scipy.integrate import quad, solve_ivp

from benchmarks import friction_laws as truth
from identification import IdentificationError, bound_of, fit_structured
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.hysteresis import hysteresis_step
from identification.models.structured.laws import BoucWen, Jenkins, PolynomialSpring
from identification.models.structured.nudging import ends_of_steps
from identification.models.structured.parameters import Parameters
from tests.identification.models.structured.models import RATE_HZ, beam, multisine
from tests.refused import refused

LAWS = {
    "softens": BoucWen(2.0, 0.3, 1.0, 0.5),
    "sharp": BoucWen(2.0, 0.3, 3.0, -0.4),
    "hardens": BoucWen(2.0, 0.8, 1.0, -1.375),
    "blunt": BoucWen(2.0, 0.3, 1.3, 0.0),
    "class II": BoucWen(2.0, 0.3, 1.5, 1.6),
}


def step(law, r, way):
    """Mean force, force at the end, and their derivatives."""
    return hysteresis_step(r, *law.sliders()[:, 0], *law.bends()[:, 0], way)


def equation(law, x, r, sign):
    """``dr/dx`` as Wen wrote it, along the direction ``sign``."""
    beta = law.stiffness_n * (law.stiffness_n * law.slip) ** -law.exponent
    return law.stiffness_n - (beta * np.sign(r * sign) + beta * law.gamma) * abs(r) ** law.exponent


def solved(law, r, way):
    """Mean force and force at the end by an integrator; it restarts where the force goes through zero."""
    sign, at, state = np.sign(way), 0.0, np.array([r, 0.0])

    def through_zero(x, state):
        return state[0]

    through_zero.terminal = True
    while at < abs(way) * (1.0 - 1e-12):
        found = solve_ivp(
            lambda x, y: [sign * equation(law, x, y[0], sign), y[0]],
            (at, abs(way)),
            state,
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=through_zero if sign * state[0] < 0.0 else None,
        )
        at, state = float(found.t[-1]), found.y[:, -1].copy()
        if at < abs(way) * (1.0 - 1e-12):
            state[0] = 1e-14 * sign
    return state[1] / abs(way), state[0]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("share", "way"), [(0.0, 0.02), (0.5, 0.01), (-0.5, 0.3), (0.6, -0.05), (0.3, -1.0)])
def test_a_step_is_the_solution_of_the_equation(name, share, way):
    law = LAWS[name]
    r = share * min(law.stiffness_n * law.slip, law.sliders()[1, 0])
    found = step(law, r, way)
    exact = solved(law, r, way)
    np.testing.assert_allclose(found[:2], exact, rtol=2e-5, atol=2e-6)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("share", "way"), [(0.1, 0.02), (-0.5, 0.3), (0.6, -0.05), (0.3, -0.7)])
def test_derivatives_of_a_step_are_those_of_finite_differences(name, share, way):
    law = LAWS[name]
    r, small = share * min(law.stiffness_n * law.slip, law.sliders()[1, 0]), 1e-5
    found = step(law, r, way)
    by_way = (np.array(step(law, r, way + small)) - step(law, r, way - small))[:2] / (2.0 * small)
    by_r = (np.array(step(law, r + small, way)) - step(law, r - small, way))[:2] / (2.0 * small)
    np.testing.assert_allclose([found[2], found[4]], by_way, atol=2e-4 * law.stiffness_n)
    np.testing.assert_allclose([found[3], found[5]], by_r, atol=2e-4)


def test_a_large_exponent_is_a_jenkins_slider():
    law, slider = BoucWen(2.0, 0.3, 400.0, 0.0), Jenkins(2.0, 0.3)
    r, other = 0.0, 0.0
    stiffness, strength = slider.sliders()[:, 0]
    for way in np.diff(0.8 * np.sin(np.linspace(0.0, 20.0, 400))):
        r, other = step(law, r, way)[1], float(np.clip(other + stiffness * way, -strength, strength))
        assert r == pytest.approx(other, abs=5e-3 * strength)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0.05, 3.0),
    st.floats(0.75, 6.0),
    st.floats(-3.0, 3.0),
    st.lists(st.floats(-0.7, 0.7), min_size=2, max_size=12),
)
def test_no_way_gives_back_more_than_was_stored(slip, exponent, gamma, ways):
    """Stored is what unloading gives back; whatever the numbers, the law is passive."""
    law = BoucWen(1.0, slip, exponent, gamma)

    def stored(r):
        def density(rho):
            return rho / (1.0 + (1.0 - gamma) * (rho / slip) ** exponent)

        return quad(density, 0.0, abs(r), epsabs=1e-12, epsrel=1e-10)[0]

    r, energy, strength = 0.0, 0.0, law.sliders()[1, 0]
    for way in ways:
        mean, r, *_ = step(law, r, way)
        before, energy = energy, stored(r)
        assert abs(r) <= strength * (1.0 + 1e-12)
        assert mean * way - (energy - before) >= -2e-5 * max(abs(mean * way), energy)


def with_hysteresis(law=LAWS["hardens"], **changes):
    """The beam with a hysteresis and a Jenkins slider in one element, and a hysteresis in the other."""
    first, second = beam().elements
    elements = (
        NonlinearElement(direction=first.direction, scale_m=1e-3, laws=(Jenkins(2.0, 0.3), law)),
        NonlinearElement(
            direction=second.direction, scale_m=2e-3, laws=(PolynomialSpring((-1.0, 2.0)), BoucWen(3.0, 0.5, 1.5, 0.7))
        ),
    )
    return beam(elements=elements, **changes)


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_of_a_run_are_those_of_finite_differences(name):
    start = with_hysteresis(LAWS[name])
    parameters = Parameters(start, (0,), True)
    vector, u = parameters.vector(start), multisine(2.0, 4)[:, :150]
    found, exact = parameters.derivatives(start, u, 20)
    np.testing.assert_allclose(found, start.simulate(u).outputs[:, 20:].T, rtol=1e-12)
    for column, number in enumerate(parameters.names):
        change = 1e-6 * max(abs(vector[column]), 1e-1) * np.eye(vector.size)[column]
        more, less = (parameters.model(vector + sign * change).simulate(u).outputs[:, 20:].T for sign in (1.0, -1.0))
        differences = (more - less) / (2.0 * change[column])
        size = np.linalg.norm(exact[..., column])
        assert np.linalg.norm(differences - exact[..., column]) <= 2e-4 * size + 1e-9, number


def one_mode(law, **changes):
    """One mode of 25 Hz with a hysteresis."""
    numbers = {
        "frequency_hz": [25.0],
        "damping_ratio": [0.01],
        "input_shapes": [[1.0]],
        "output_shapes": [[1.0], [1.0], [1.0]],
        "direct": np.zeros((3, 1)),
        "elements": (NonlinearElement(direction=[1.0], scale_m=1e-3, laws=(law,)),),
        "support_n_m": 0.0,
    }
    return beam(**(numbers | changes))


@njit(cache=True)
def rates(t, state, step_s, u, numbers):
    """One mode with Wen's equation, over time."""
    omega, zeta, k, beta, gamma, n = numbers
    q, v, r = state
    at = min(int(t / step_s), u.size - 2)
    force = u[at] + (u[at + 1] - u[at]) * (t / step_s - at)
    dr = k * v - beta * abs(v) * abs(r) ** (n - 1.0) * r - gamma * v * abs(r) ** n
    return np.array([v, force - 2.0 * zeta * omega * v - omega**2 * q - r, dr])


@pytest.mark.parametrize("name", ["softens", "hardens"])
def test_a_run_tends_to_the_solution_of_the_equation_with_the_square_of_the_step(name):
    law, u, errors = LAWS[name], multisine(2.0, 2)[:, :250], []
    stiffness = law.stiffness_n / 1e-3
    beta = stiffness * (law.stiffness_n * law.slip) ** -law.exponent
    for steps in (4, 8):
        model = one_mode(law, steps=steps)
        ends = ends_of_steps(u, steps)[:, 0]
        times = np.arange(ends.size) / (RATE_HZ * steps)
        found = solve_ivp(
            rates,
            (0.0, times[-1]),
            np.zeros(3),
            method="DOP853",
            t_eval=times[:-1:steps],
            rtol=1e-9,
            atol=1e-14,
            max_step=times[1],
            args=(times[1], ends, (50.0 * np.pi, 0.01, stiffness, beta, beta * law.gamma, law.exponent)),
        )
        difference = model.simulate(u).displacement - found.y[:1]
        errors.append(np.linalg.norm(difference) / np.linalg.norm(found.y[:1]))
        assert np.max(np.abs(found.y[0])) > 5e-4  # half of the scale
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("law", [BoucWen(5.0, 0.4, 1.5, 0.3), BoucWen(5.0, 0.4, 1.0, 1.8)])
def test_no_run_exceeds_its_bound(law):
    model, samples = one_mode(law, damping_ratio=[0.03]), 4000
    times = np.arange(samples) / RATE_HZ
    for force in (30.0 * np.sign(np.sin(2.0 * np.pi * 25.0 * times)), 5.0 * np.sin(2.0 * np.pi * 26.0 * times)):
        found = model.simulate(force[None])
        bound = bound_of(model, float(np.max(np.abs(force))))
        assert found.unsolved_steps == 0
        assert np.max(np.abs(found.displacement)) < bound.output_m[0] < 100.0 * np.max(np.abs(found.displacement))


def test_numbers_that_a_hysteresis_cannot_have_are_refused():
    with refused(IdentificationError, "exponent-is", field="bouc-wen", allowed="numbers from 0.75"):
        BoucWen(1.0, 1.0, 0.5)
    with refused(IdentificationError, "slip-is", field="bouc-wen", allowed="numbers above 0"):
        BoucWen(1.0, 0.0)


@pytest.mark.slow
def test_a_fit_finds_the_law_of_the_benchmark_of_noel_and_schoukens():
    """Simulated by Wen's equation, with noise of 0.1 % of force and acceleration; beta and gamma have opposite signs."""
    training = [truth.experiment("benchmark", 1.0, 1, truth.NOISE)]
    fit = fit_structured(truth.modes("benchmark"), training, laws=(BoucWen(),), support=False, steps=4)
    (element,) = fit.model.elements
    (law,) = element.laws
    assert fit.training_error < 1e-3
    assert not fit.not_identified
    moves = element.scale_m / (element.direction[0] * np.sqrt(2.0))  # of the mass of 2 kg, per x
    assert law.gamma == pytest.approx(-1100.0 / 800.0, rel=1e-3)
    assert law.exponent == pytest.approx(1.0, rel=5e-3)
    assert law.slip * abs(moves) == pytest.approx(1.0 / 800.0, rel=5e-3)
    assert law.stiffness_n / element.scale_m * element.direction[0] ** 2 * 2.0 == pytest.approx(5e4, rel=5e-3)
    for level, largest in ((1.0, 5e-4), (2.0, 1e-3)):
        fresh = truth.experiment("benchmark", level, 7, 0.0)
        found = fit.model.simulate_experiment(fresh).outputs[:, fresh.counted_from :]
        assert np.linalg.norm(found - fresh.counted_outputs) < largest * np.linalg.norm(fresh.counted_outputs)
