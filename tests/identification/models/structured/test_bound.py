"""The bound of structured models: closed form of one linear mode, random models and forces far beyond the data."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification import IdentificationError
from identification.models.structured.bound import _with, bound_of
from identification.models.structured.elements import NonlinearElement, Tables
from identification.models.structured.laws import Iwan, Jenkins, PolynomialDamper, PolynomialSpring
from identification.models.structured.steps import System
from tests.identification.models.structured.models import RATE_HZ, beam, multisine
from tests.refused import refused


def resonant_sine(model, peak_n, seconds=20.0):
    samples = int(seconds * RATE_HZ)
    return peak_n * np.sin(2.0 * np.pi * model.frequency_hz[0] * np.arange(samples) / RATE_HZ)[None]


def test_a_linear_mode_comes_within_three_of_its_bound():
    """A sine at resonance has the amplitude ``b F/(2 zeta omega^2)``, which no bound may undercut."""
    model = beam(
        frequency_hz=[25.0], damping_ratio=[0.01], input_shapes=[[0.9]], output_shapes=[[0.9], [1.4], [0.5]],
        elements=(), support_n_m=0.0,
    )  # fmt: skip
    amplitude = 0.9 * np.sqrt(2.0) / (2.0 * 0.01 * model.omega[0] ** 2)
    found = bound_of(model, 1.0)
    assert 0.9 * amplitude < found.output_m[0] < 3.0 * 0.9 * amplitude
    assert 0.9 * amplitude * model.omega[0] < found.output_m_s[0] < 3.0 * 0.9 * amplitude * model.omega[0]
    assert 0.3 < found.memory_s * 2.0 * 0.01 * model.omega[0] < 10.0
    twice = bound_of(model, 2.0)
    np.testing.assert_allclose(twice.output_m, 2.0 * found.output_m)


LAWS = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=5)


@settings(max_examples=25, deadline=None)
@given(
    LAWS,
    st.floats(0.0, 2.0),
    st.floats(0.01, 3.0),
    st.floats(-1.0, 1.0),
    st.integers(0, 99),
    st.sampled_from([1, 2, 4]),
)
def test_no_random_or_resonant_force_exceeds_the_bound(springs, damper, friction, across, seed, steps):
    first = NonlinearElement(
        direction=[0.9, across],
        scale_m=1e-3,
        laws=(PolynomialSpring(tuple(springs)), PolynomialDamper((damper,)), Jenkins(friction, 0.5)),
    )
    second = NonlinearElement(direction=[across, 0.7], scale_m=2e-3, laws=(Iwan(stiffness_n=friction, count=3),))
    model = beam(elements=(first, second), steps=steps, support_n_m=0.0)
    force = resonant_sine(model, 100.0, 4.0) if seed % 2 else multisine(100.0, seed, 4000)
    rms = np.max(np.abs(force)) if seed % 2 else np.sqrt(np.mean(force**2)) * 2.0  # the peak of a mean over the memory
    found, motion = bound_of(model, float(rms)), model.simulate(force)
    assert motion.unsolved_steps == 0
    for element, largest in zip(model.elements, found.displacement_m, strict=True):
        assert np.max(np.abs(element.direction @ motion.displacement)) <= largest
    assert np.all(np.max(np.abs(model.output_shapes @ motion.velocity), axis=1) <= found.output_m_s)


def test_far_beyond_the_data_the_largest_response_is_within_ten_of_the_bound():
    model = beam(support_n_m=0.0)
    peak = 300.0
    motions = [model.simulate(resonant_sine(model, peak))]
    for _ in range(8):  # the force that does most work: against the velocity of the last run
        motions.append(model.simulate(peak * np.sign(model.input_shapes[:, 0] @ motions[-1].velocity)[None]))
    found = bound_of(model, peak)
    largest = max(np.max(np.abs(model.elements[0].direction @ motion.displacement)) for motion in motions)
    assert largest < found.displacement_m[0] < 10.0 * largest


def test_a_force_that_is_not_above_zero_is_refused():
    with refused(IdentificationError, field="force_rms_n", allowed="finite and above zero"):
        bound_of(beam(), 0.0)


def one_mode(stiffness, damper, step_s=0.01, omega=100.0, zeta=0.2):
    """A mode, and one element whose spring is cubic up to 1 and straight with this slope beyond, with a constant damper."""
    x = np.linspace(-1.0, 1.0, 201)
    spring = [stiffness * x**3 / 3.0, stiffness * x**2, stiffness * x**4 / 12.0]
    tables = Tables(
        springs=np.array([spring]),
        dampers=np.full((1, 201), damper),
        limits=np.array([[1.0, stiffness, stiffness]]),
        sliders=np.zeros((0, 2)),
        bends=np.zeros((0, 3)),
        first=np.zeros(2, int),
        bent=np.zeros(1, bool),
    )
    one = np.ones((1, 1))
    return System(step_s, 1, omega * one[0], zeta * one[0], one, 1, one, tables, np.zeros(3))


@pytest.mark.parametrize("damper", [0.0, 60.0])
@pytest.mark.parametrize("stiffness", [3e3, 1e4, 3e4])
@pytest.mark.parametrize("eps_share", [0.1, 0.5])
def test_the_energy_after_a_step_is_within_what_the_step_takes(stiffness, damper, eps_share):
    """``W <= mu S`` without a force, S and W as in the module's text, W with the spring's own force and potential."""
    omega, c, theta = 100.0, 40.0, 0.5
    found = _with(one_mode(stiffness, damper), 1.0, eps_share, theta, 0.0)
    assert found is not None
    mu, eps, h = (1.0 - theta) / found[1], eps_share * c, 0.01
    angle, far = np.meshgrid(np.linspace(0.0, np.pi, 721), np.geomspace(0.1, 1e3, 41))
    mean_v, mean_q = far * omega * np.cos(angle), far * np.sin(angle)
    beyond = np.abs(mean_q) > 1.0
    force = np.where(
        beyond, np.sign(mean_q) * stiffness * (1.0 / 3.0 + np.abs(mean_q) - 1.0), stiffness * mean_q**3 / 3.0
    )
    v = mean_v - 0.5 * h * ((c + damper) * mean_v + omega**2 * mean_q + force)
    q = mean_q + 0.5 * h * mean_v
    over = np.abs(q) - 1.0
    potential = np.where(over > 0.0, stiffness * (1.0 / 12.0 + over / 3.0 + 0.5 * over**2), stiffness * q**4 / 12.0)
    energy = 0.5 * v**2 + 0.5 * omega**2 * q**2 + potential + eps * (q * v + 0.5 * c * q**2)
    taken = (c - eps - eps * stiffness * h**2 / 12.0) * mean_v**2
    taken += eps * (omega**2 - 0.25 * eps * damper) * mean_q**2
    assert np.max(energy / taken) < mu < 10.0 * np.max(energy / taken)
