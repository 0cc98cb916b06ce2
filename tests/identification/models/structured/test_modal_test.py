"""Rows of a modal test: the small vibrations that `StructuredModel.linearised` finds from poles, and their changes."""

from dataclasses import replace

import numpy as np
import pytest

from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import Masing
from identification.models.structured.parameters import Parameters
from identification.models.structured.problem import ModalTest
from tests.identification.models.structured.models import beam, linear_modes

STEP = 1e-4


def seen(model):
    """Logarithms of frequencies and damping ratios of small vibrations, from poles."""
    found = model.linearised()
    return np.concatenate([np.log(found.frequency_hz), np.log(found.damping_ratio)])


def small_of(model):
    """Small vibrations of a model, with the signs that its own modes have."""
    small = model.linearised()
    sign = np.sign(small.input_shapes * model.input_shapes)
    return replace(small, input_shapes=small.input_shapes * sign, output_shapes=small.output_shapes * sign.T)


def test_a_modal_test_of_the_model_itself_leaves_nothing():
    model = beam()
    small, parameters = small_of(model), Parameters(model, (0,), False)
    test = ModalTest(parameters, linear_modes(small, len(model.omega)), small)
    left = test.rows(parameters.vector(model))[:, -1] * test.std
    assert left == pytest.approx(0.0, abs=2e-4)  # the damping that couples modes is left out


def test_the_slipping_modes_are_not_compared_with_it():
    model = beam()
    slipping, parameters = beam(elements=()), Parameters(model, (0,), False)
    test = ModalTest(parameters, linear_modes(slipping, len(model.omega)), slipping)
    assert np.max(np.abs(test.rows(parameters.vector(model))[:, -1])) > 10.0


def test_derivatives_are_those_of_the_poles():
    model = beam()
    small, parameters = model.linearised(), Parameters(model, (0,), False)
    test = ModalTest(parameters, linear_modes(small, len(model.omega)), small)
    vector, count = parameters.vector(model), 2 * len(model.omega)
    rows = (test.rows(vector) * test.std[:, None])[:count, :-1]
    for number, name in enumerate(parameters.names):
        less, more = vector.copy(), vector.copy()
        less[number] -= STEP
        more[number] += STEP
        change = (seen(parameters.model(more)) - seen(parameters.model(less))) / (2.0 * STEP)
        np.testing.assert_allclose(rows[:, number], change, rtol=1e-3, atol=1e-4, err_msg=name)


def test_a_slider_without_stiffness_has_its_derivative_too():
    joint = NonlinearElement(direction=[0.9, -0.1], scale_m=1e-3, laws=(Masing((0.0, 2.0), (0.1, 0.3)),))
    model = beam(elements=(joint,))
    small, parameters = model.linearised(), Parameters(model, (0,), False)
    test = ModalTest(parameters, linear_modes(small, len(model.omega)), small)
    vector, number = parameters.vector(model), parameters.names.index("element 1 masing stiffness_n[0]")
    more = vector.copy()
    more[number] += STEP
    change = (seen(parameters.model(more)) - seen(model)) / STEP
    found = (test.rows(vector) * test.std[:, None])[: change.size, number]
    np.testing.assert_allclose(found, change, rtol=1e-3, atol=1e-5)


def test_directions_that_wait_are_no_free_numbers_and_come_back_unchanged():
    model = beam()
    waiting, free = Parameters(model, (0,), False, turned=False), Parameters(model, (0,), False)
    assert set(free.names) - set(waiting.names) == {"element 1 direction 2", "element 2 direction 2"}
    for element, kept in zip(waiting.model(1.01 * waiting.vector(model)).elements, model.elements, strict=True):
        np.testing.assert_array_equal(element.direction, kept.direction)
