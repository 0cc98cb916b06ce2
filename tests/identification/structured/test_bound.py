"""The bound of structured models: closed form of one linear mode, random models and forces far beyond the data."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import IdentificationError
from identification.structured.bound import bound_of
from identification.structured.elements import NonlinearElement
from identification.structured.laws import Iwan, Jenkins, PolynomialDamper, PolynomialSpring
from tests.identification.structured.models import RATE_HZ, beam, multisine


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
    with pytest.raises(IdentificationError, match=r"force_rms_n: is 0, must be finite and above zero"):
        bound_of(beam(), 0.0)
