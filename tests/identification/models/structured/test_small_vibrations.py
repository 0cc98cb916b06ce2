"""Small vibrations of structured models against numerical derivatives of the laws, and small simulated ones."""

from dataclasses import replace

import numpy as np
import pytest

from identification import IdentificationError, NonlinearElement
from identification.models.structured.laws import Jenkins, Joint, PolynomialDamper, PolynomialSpring, Spring, UserSpring
from tests.identification.models.structured.models import beam, multisine
from tests.refused import refused

NEAR = 1e-6


def line(x, numbers):
    """A spring with a slope at rest."""
    return numbers[0] * x


def sloped(newtons: float) -> UserSpring:
    return UserSpring(f"{__name__}:line", (newtons,))


def force(model, q):
    """Modal forces of linear part, springs and stuck sliders at small displacements, from the laws themselves."""
    total = model.omega**2 * q
    for element in model.elements:
        x = element.phi @ q
        for law in element.laws:
            if isinstance(law, Spring):
                total = total + element.direction * law.force(np.array([x]))[0]
            if isinstance(law, Joint):
                total = total + element.direction * np.sum(law.sliders()[0]) * x
    return total


@pytest.mark.parametrize("stiffness_n", [0.0, 3.0])
def test_poles_are_those_of_the_jacobian_at_rest(stiffness_n):
    model = beam()
    (first, second) = model.elements
    model = replace(model, elements=(first, replace(second, laws=(*second.laws, sloped(stiffness_n)))))
    found = model.linearised()
    nudges = NEAR * np.array([1e-3, 1e-3])
    stiffness = np.array([(force(model, d) - force(model, -d)) / (2.0 * np.max(d)) for d in np.diag(nudges)]).T
    n = len(model.omega)
    jacobian = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-stiffness, -np.diag(2.0 * model.damping_ratio * model.omega)]]
    )
    poles = np.linalg.eigvals(jacobian)
    poles = np.sort_complex(poles[poles.imag > 0.0])
    np.testing.assert_allclose(found.frequency_hz, np.sort(np.abs(poles)) / (2.0 * np.pi), rtol=1e-6)
    order = np.argsort(np.abs(poles))
    np.testing.assert_allclose(found.damping_ratio, (-poles.real / np.abs(poles))[order], rtol=1e-6)
    assert found.frequency_hz[0] > 1.05 * model.frequency_hz[0]
    static = model.output_shapes @ np.linalg.solve(stiffness, model.input_shapes)
    modal = found.output_shapes @ (found.input_shapes / found.omega[:, None] ** 2)
    np.testing.assert_allclose(modal, static, rtol=1e-3)


def test_a_small_simulation_is_that_of_the_small_vibrations():
    model = beam(steps=16, support_n_m=0.0)
    small = multisine(1e-5, 1)
    exact, linear = model.simulate(small).outputs, model.linearised().simulate(small).outputs
    slipping = replace(model, elements=()).simulate(small).outputs
    size = np.linalg.norm(exact, axis=1)
    assert np.all(np.linalg.norm(linear - exact, axis=1) < 3e-3 * size)
    assert np.all(np.linalg.norm(slipping - exact, axis=1) > 0.2 * size)


def test_laws_without_slope_change_nothing():
    smooth = NonlinearElement(
        direction=[0.9, -0.1], scale_m=1e-3, laws=(PolynomialSpring((1.0, 2.0)), PolynomialDamper((1.0, 1.0)))
    )
    model = beam(elements=(smooth,))
    found = model.linearised()
    for name in ("frequency_hz", "damping_ratio"):
        np.testing.assert_allclose(getattr(found, name), getattr(model, name), rtol=1e-9)
    assert found.elements == ()
    assert beam(elements=()).linearised().elements == ()


def test_a_structure_that_buckles_at_rest_has_no_small_vibrations():
    soft = NonlinearElement(direction=[0.9, -0.1], scale_m=1e-3, laws=(sloped(-1e3), Jenkins(1.0)))
    with refused(IdentificationError, "at-rest-mode-does-not-oscillate", field="elements"):
        beam(elements=(soft,)).linearised()
