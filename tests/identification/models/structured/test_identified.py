"""Which numbers count as identified: intervals against the size of the number, bounds, and what no data show."""

from dataclasses import replace

import numpy as np
import pytest

from identification.models.structured.identified import fitted_numbers
from identification.models.structured.laws import Iwan, Jenkins, PolynomialSpring
from identification.models.structured.parameters import Parameters
from identification.models.structured.problem import ModalTest, Problem, _inverse
from identification.models.structured.progress import FitWatch
from tests.identification.models.structured.models import beam, linear_modes
from tests.identification.models.structured.test_fit import experiment

TRUE = beam()
ELEMENT = replace(TRUE.elements[0], laws=(PolynomialSpring((3.0,)), Iwan(3.0, 2.0, 0.0)))
START = beam(elements=(ELEMENT,), support_n_m=800.0)
PARAMETERS = Parameters(START, (0,), True)
VECTOR = PARAMETERS.vector(START)


def numbers(name, std=0.0, value=None, unseen=()):
    """What is said of one number with a standard error, the others being known to 1e-6."""
    at = PARAMETERS.names.index(name)
    vector, errors = VECTOR.copy(), np.full(VECTOR.size, 1e-6)
    errors[at] = std
    if value is not None:
        vector[at] = value
    found = fitted_numbers(PARAMETERS, vector, np.diag(errors**2), unseen)
    assert [one.name for one in found if one.unknown and one.name != name] == []
    (of,) = (one for one in found if one.name == name)
    return of


SPRING = "element 1 polynomial-spring coefficients_n[0]"


@pytest.mark.parametrize(
    ("name", "std", "unknown"),
    [
        (SPRING, 0.9 * 3.0 / 3.92, ""),
        (SPRING, 1.1 * 3.0 / 3.92, "wide"),
        ("support", 0.9 * 800.0 / 3.92, ""),
        ("support", 1.1 * 800.0 / 3.92, "wide"),
        # by its logarithm: exp(v) - exp(-v) is 1 at v = asinh(1/2)
        ("element 1 iwan slip", 0.99 * np.arcsinh(0.5) / 1.96, ""),
        ("element 1 iwan slip", 1.01 * np.arcsinh(0.5) / 1.96, "wide"),
        # an exponent, 0 here: half of its range
        ("element 1 iwan chi", 0.3, ""),
        ("element 1 iwan chi", 0.6, "wide"),
        (SPRING, 0.0, "no effect"),
    ],
)
def test_an_interval_wider_than_the_number_says_that_it_is_not_identified(name, std, unknown):
    assert numbers(name, std).unknown == unknown


def test_intervals_are_in_the_units_of_the_number():
    slip = numbers("element 1 iwan slip", 0.1)
    assert (slip.low, slip.value, slip.high) == pytest.approx((2.0 * np.exp(-0.196), 2.0, 2.0 * np.exp(0.196)))
    support = numbers("support", 100.0)
    assert (support.low, support.value, support.high) == pytest.approx((604.0, 800.0, 996.0))


def test_a_number_at_its_bound_is_not_identified():
    at = PARAMETERS.names.index("element 1 iwan slip")
    largest = PARAMETERS.bounds(VECTOR)[1][at]
    assert numbers("element 1 iwan slip", 1e-6, largest).unknown == "at its bound"
    assert numbers("element 1 iwan slip", 1e-6, largest - 0.01).unknown == ""
    assert numbers("support", 1.0, 0.0).unknown == "at its bound"


def test_what_no_data_show_has_no_interval():
    found = numbers("support", 1.0, unseen=("support",))
    assert found.unknown == "no effect"
    assert np.isnan([found.low, found.high]).all()


def test_units_do_not_count_and_what_no_row_shows_is_left_out():
    rows = np.random.default_rng(1).standard_normal((20, 3)) * [1.0, 1e-9, 0.0]
    found, unseen = _inverse(rows)
    assert unseen.tolist() == [False, False, True]
    units = np.array([1.0, 1e-9])
    exact = np.linalg.inv((rows[:, :2] / units).T @ (rows[:, :2] / units)) / np.outer(units, units)
    np.testing.assert_allclose(found[:2, :2], exact, rtol=1e-9)
    assert not found[2].any()


def test_numbers_that_count_only_together_are_not_identified():
    rows = np.random.default_rng(1).standard_normal((20, 2))[:, [0, 1, 1]]
    found, unseen = _inverse(rows)
    assert unseen.tolist() == [False, True, True]
    np.testing.assert_allclose(found, np.linalg.pinv(rows.T @ rows), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("slip", "unknown"), [(0.5, ""), (30.0, "no effect")])
def test_the_slip_of_a_slider_that_never_slips_has_no_effect_on_the_data(slip, unknown):
    joint = replace(ELEMENT, laws=(PolynomialSpring((3.0,)), Jenkins(3.0, slip)))
    true, linear = (beam(elements=elements, support_n_m=0.0) for elements in ((joint,), ()))
    data, parameters = experiment(true, noise=1e-3), Parameters(true, (0,), False)
    test = ModalTest(parameters, linear_modes(true, 1), linear)
    vector = parameters.vector(true)
    problem = Problem(parameters, [data], [None], test, 0.01, FitWatch(None, 1, 1))
    covariance, _, unseen, *_ = problem.uncertainty(vector)
    named = [name for name, one in zip(parameters.names, unseen, strict=True) if one]
    found = {one.name: one.unknown for one in fitted_numbers(parameters, vector, covariance, named)}
    assert found["element 1 jenkins slip"] == unknown
    assert found["element 1 polynomial-spring coefficients_n[0]"] == ""
