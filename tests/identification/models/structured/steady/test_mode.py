"""The nonlinear mode of a structured model: closed forms, and errors against models that are moved by them."""

from dataclasses import replace

import numpy as np
import pytest

from identification import IdentificationError, NonlinearElement, StructuredFit, backbone, structured_mode
from identification.fitting.result import FitStatus
from identification.models.structured.laws import Jenkins, PolynomialSpring
from identification.models.structured.parameters import Parameters
from tests.identification.models.pnlss.steady.oscillators import shaker
from tests.identification.models.structured.steady.beams import beam, friction
from tests.refused import refused

CUBIC_N = 0.4


def duffing(cubic_n=CUBIC_N, **changes):
    """A cubic spring along the drive point's part of the first mode, with the range of its training."""
    spring = NonlinearElement(
        direction=[0.9, 0.0], scale_m=1e-3, laws=(PolynomialSpring((0.0, cubic_n)),), largest=1.0, **changes
    )
    return beam(spring)


def fit_of(model, std):
    """A fit whose numbers have the given standard errors by name, all others being exact."""
    parameters = Parameters(model, (0,), False)
    assert set(std) <= set(parameters.names)
    variance = [std.get(name, 0.0) ** 2 for name in parameters.names]
    return StructuredFit(
        model=model,
        start=model,
        names=parameters.names,
        values=parameters.vector(model),
        covariance=np.diag(variance),
        training_error=0.01,
        evaluations=1,
        seconds=1.0,
        status=FitStatus.CONVERGED,
        message="",
    )


def exact(fit):
    """The fit without a residual: beyond the training data its errors are those of its numbers, if springs are linear."""
    return replace(fit, training_error=0.0)


def test_frequency_and_damping_are_those_of_the_closed_form_up_to_the_training_range():
    found = structured_mode(duffing())
    x = 1e3 * found.amplitude_m  # the element moves as the drive point but for the second mode
    own = 2.0 * np.pi * 25.0
    stiffness = 0.75 * CUBIC_N / 1e-3 * 0.81 * x**2  # of the first harmonic
    np.testing.assert_allclose(found.modal_frequency_hz, np.sqrt(own**2 + stiffness) / (2.0 * np.pi), rtol=2e-4)
    np.testing.assert_allclose(found.damping_ratio, 0.01 * 25.0 / found.modal_frequency_hz, rtol=2e-2)
    assert 0.9 < x[-1] < 1.02
    assert found.modal_frequency_hz[-1] > 1.001 * found.modal_frequency_hz[0]
    assert np.isnan(found.modal_frequency_std_hz).all()
    np.testing.assert_allclose(found.phase_lag_deg, 90.0, atol=1e-6)


def test_points_are_those_of_the_backbone():
    model = duffing()
    found = structured_mode(model, 1.5)
    curve = backbone(model, 1.5, support=True, largest_range_use=3.0)
    sizes = np.abs(curve.displacement_m[:, 1, 0])
    np.testing.assert_allclose(found.amplitude_m[-1], sizes[-1], rtol=0.01)
    np.testing.assert_allclose(found.frequency_hz[-1], curve.frequency_hz[-1], rtol=1e-9)


def test_errors_of_frequency_and_damping_are_those_of_their_numbers():
    found = structured_mode(fit_of(duffing(), {"frequency 1": 1e-3, "damping 1": 0.05}))
    own = 25.0**2 / found.modal_frequency_hz
    np.testing.assert_allclose(found.modal_frequency_std_hz, 1e-3 * own, rtol=2e-3)
    np.testing.assert_allclose(found.damping_ratio_std / found.damping_ratio, 0.05, rtol=0.02)


@pytest.mark.parametrize("joint", [False, True])
def test_errors_are_how_far_the_curves_of_models_apart_by_them_lie_apart(joint):
    if joint:
        slider = NonlinearElement(
            direction=[0.9, 0.0], scale_m=1e-3, laws=(Jenkins(stiffness_n=0.15, slip=0.2),), largest=1.0
        )
        model, name, std = beam(slider), "element 1 jenkins stiffness_n", 0.02
    else:
        model, name, std = duffing(), "element 1 polynomial-spring coefficients_n[1]", 0.02
    fit = fit_of(model, {name: std})
    parameters = Parameters(model, (0,), False)
    moved = np.where(np.array(fit.names) == name, std, 0.0)
    found = structured_mode(fit)
    ends = [
        backbone(parameters.model(fit.values + sign * moved), 1.3 * found.force_n[-1], largest_range_use=3.0)
        for sign in (1, -1)
    ]
    curves = [np.interp(found.amplitude_m, np.abs(end.displacement_m[:, 1, 0]), end.frequency_hz) for end in ends]
    half = 0.5 * np.abs(curves[0] - curves[1])
    inside = found.amplitude_m > 0.4e-3
    assert inside.sum() > 3
    np.testing.assert_allclose(found.modal_frequency_std_hz[inside], half[inside], rtol=0.05)


def test_a_joint_softens_and_damps():
    found = structured_mode(friction(), 0.4)
    assert found.modal_frequency_hz[-1] < 0.995 * found.modal_frequency_hz[0]
    assert found.damping_ratio[-1] > 1.2 * found.damping_ratio[0]


def test_what_has_no_mode_is_refused():
    (element,) = duffing().elements
    unknown = beam(replace(element, largest=None))
    with refused(IdentificationError, "missing-the-model-does-not-know", field="force_n"):
        structured_mode(unknown)


def test_with_an_exciter_the_damping_is_that_of_the_same_amplitude():
    (spring,) = duffing().elements
    model = beam(
        replace(spring, largest=spring.reach)
    )  # within the training data errors are those of the numbers alone
    alone = structured_mode(model, 1.0)
    driven = structured_mode(exact(fit_of(model, {"damping 1": 0.05})), 1.0, force="fundamental", exciter=shaker())
    at = np.interp(driven.amplitude_m, alone.amplitude_m, alone.damping_ratio)
    np.testing.assert_allclose(driven.damping_ratio, at, rtol=5e-3)
    np.testing.assert_allclose(driven.damping_ratio_std / driven.damping_ratio, 0.05, rtol=0.02)
    assert np.max(driven.force_harmonic_ratio(3)) > 1e-4


@pytest.mark.parametrize(("name", "exponent"), [("damping 1", 1.0), ("shape 1 at force", 0.0)])
def test_the_damping_is_in_proportion_to_that_of_the_mode_and_not_to_its_shape_at_the_force(name, exponent):
    """At one amplitude A of the drive point ``D = F phi^2 / (2 w^2 A)`` with ``F = 2 z w^2 A / phi^2``: phi drops out."""
    found = structured_mode(exact(fit_of(duffing(0.0), {name: 0.01})), 1.0)
    np.testing.assert_allclose(found.damping_ratio_std / found.damping_ratio, 0.01 * exponent, rtol=0.02, atol=1e-5)


def test_the_damping_follows_the_modal_frequency_as_far_as_the_spring_hardens_it():
    """``D = z w_1 / w`` and ``w^2 = w_1^2 + k(A)``: a relative change e of w_1 changes D by ``e (1 - w_1^2 / w^2)``."""
    found = structured_mode(fit_of(duffing(40.0 * CUBIC_N), {"frequency 1": 1e-3}))
    expected = 1e-3 * (1.0 - (25.0 / found.modal_frequency_hz) ** 2)
    assert expected[-1] > 5e-5
    np.testing.assert_allclose(found.damping_ratio_std / found.damping_ratio, expected, rtol=0.05, atol=3e-6)
