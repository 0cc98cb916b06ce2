"""What the training data leave open beyond their range: other laws, the force that reaches it, bands and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from identification import ExtrapolationError, backbone, frequency_response
from identification.models import (
    BoucWen,
    Coulomb,
    Jenkins,
    Masing,
    PolynomialDamper,
    PolynomialSpring,
    SplineSpring,
    Stop,
)
from identification.models.structured.alternatives import alternatives
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.extrapolation import trained_force_n, with_what_is_open
from identification.models.structured.hysteresis import joint_forces
from identification.prediction.steady_prediction import band_of_responses
from tests.identification.models.structured.models import beam
from tests.identification.models.structured.steady.test_mode import fit_of
from tests.refused import refused

PHASE = 2.0 * np.pi * np.arange(400) / 400


def one_mode(*laws, largest=1.0):
    """Laws along the drive point's part of the first mode."""
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=laws, largest=largest, reach=6.0)
    return beam(elements=(element,), support_n_m=0.0)


def loop(element, amplitude):
    """float[n]: force of an element over a period of a sine, J, without dampers and mean, which a slider that sticks keeps."""
    x = amplitude * np.cos(PHASE)
    force = np.interp(x, element.nodes, element.spring(element.laws)[0])
    joint_forces(element.sliders(element.laws), element.bends(element.laws), x, force)
    return force - np.mean(force)


@pytest.mark.parametrize(
    "laws",
    [
        (PolynomialSpring((0.5, 1.0, -0.2)), PolynomialDamper((0.4, 0.1))),
        (SplineSpring((0.5, 0.1, 0.0, 0.0, 0.2, 0.5, 0.9)), Stop(3.0, 0.6)),
        (Masing((2.0, 1.0, 1.5), (0.3, 0.8, 1.6)),),
        (BoucWen(3.0, 1.0, 1.0, 0.2), Coulomb(0.1)),
    ],
    ids=["polynomials", "spline and stop", "joint", "hysteresis"],
)
def test_alternatives_have_the_same_forces_within_the_data_and_others_beyond(laws):
    model = one_mode(*laws)
    own, found = model.elements[0], alternatives(model)
    assert found
    for _, other in found:
        element = other.elements[0]
        inside = np.abs(own.nodes) <= 1.0
        np.testing.assert_allclose(element.damper(element.laws)[inside], own.damper(own.laws)[inside], atol=1e-12)
        size = np.max(np.abs(loop(own, 1.0)), initial=1e-6)
        np.testing.assert_allclose(loop(element, 0.99), loop(own, 0.99), atol=2e-3 * size)
        moved = loop(element, 1.8) - loop(own, 1.8)
        damped = element.damper(element.laws) - own.damper(own.laws)
        assert max(np.abs(moved).max(), np.abs(damped).max()) > 1e-4 * size


def test_sliders_that_slip_between_once_and_twice_the_range_lie_between_the_ends():
    """Stiffness and loss of the first harmonic, of any slider that the data do not show."""
    visible = (2.0, 0.3)
    model = one_mode(Masing((2.0, 1.5), (0.3, 1.0001)))
    stiff = one_mode(Masing((2.0, 1.5), (0.3, 1e6)))
    soft = dict(alternatives(model))["joint"]

    def parts(one, amplitude):
        harmonic = loop(one.elements[0], amplitude) @ np.exp(-1j * PHASE)
        return np.array([harmonic.real, harmonic.imag])

    for slip in (1.05, 1.3, 1.7):
        truth = one_mode(Masing((visible[0], 1.5), (visible[1], slip)))
        for amplitude in (1.2, 1.6, 2.0):
            ends = np.sort([parts(stiff, amplitude), parts(soft, amplitude)], axis=0)
            assert np.all(parts(truth, amplitude) >= ends[0] - 1e-9)
            assert np.all(parts(truth, amplitude) <= ends[1] + 1e-9)


@pytest.mark.parametrize(
    "laws", [(PolynomialSpring((0.0, 3.0)),), (Jenkins(4.0, 0.3), PolynomialDamper((0.003,)))], ids=["spring", "joint"]
)
def test_the_force_of_the_training_range_moves_the_model_through_it(laws):
    """By harmonic balance with one harmonic, for which secants are exact but for the second mode."""
    model = one_mode(*laws)
    force_n = trained_force_n(model, 10.0, 60.0)
    found = backbone(model, force_n, harmonics=1)
    assert found.range_use[-1] == pytest.approx(1.0, rel=2e-3)


def test_range_use_is_that_of_the_force_where_the_model_moves_too_little():
    """Damping that grows with the amplitude: at 1.5 times the force the model moves less than 1.5 times as far."""
    model = one_mode(PolynomialDamper((5.0,)))
    force_n = 1.5 * trained_force_n(model, 10.0, 60.0)
    found = frequency_response(model, force_n, harmonics=3)
    assert np.max(found.range_use) == pytest.approx(1.5, rel=0.01)
    (said,) = [note for note in found.notes if "range use" in note]
    assert said.startswith("range use is that of the force, 1.50 times the training data")
    assert found.amplitude_m().max() / 1e-3 < 1.35
    inside = frequency_response(model, 0.5 * force_n, harmonics=3)
    assert not [note for note in inside.notes if "range use" in note]


JOINT = one_mode(Jenkins(4.0, 0.3))
FORCE_N = trained_force_n(JOINT, 10.0, 60.0)


def response(model, level):
    """Response to a force over that of the training data."""
    return frequency_response(
        model, level * FORCE_N, harmonics=1, samples=128, band_hz=(24.0, 30.0), largest_range_use=9.0
    )


def open_band(level):
    """The band of a fit with an exact covariance, without draws."""
    fit, own = replace(fit_of(JOINT, {}), training_error=1e-3), response(JOINT, level)
    return with_what_is_open(fit, band_of_responses([own, own]), own, lambda model: response(model, level))


def test_a_band_holds_a_joint_whose_other_slider_the_data_do_not_show():
    """The other slider is a spring in the data, of the same stiffness as in the structure that was fitted."""
    hidden = 2.0
    truth = one_mode(Jenkins(4.0, 0.3), Jenkins(hidden, 1.2))
    softer = np.sqrt((2.0 * np.pi * JOINT.frequency_hz[0]) ** 2 - hidden / 1e-3 * 0.9**2) / (2.0 * np.pi)
    true = response(replace(truth, frequency_hz=[softer, JOINT.frequency_hz[1]]), 1.5).peak()
    own, band = response(JOINT, 1.5).peak(), open_band(1.5)
    assert own.amplitude_m > 1.1 * true.amplitude_m
    top = int(np.argmin(np.abs(band.phase_lag_deg - true.phase_lag_deg)))
    assert band.amplitude_m[0, top] < true.amplitude_m < band.amplitude_m[1, top]
    assert band.frequency_hz[0, top] < true.frequency_hz < band.frequency_hz[1, top]
    assert abs(own.amplitude_m - true.amplitude_m) < 1.96 * band.peak_amplitude_std_m


@pytest.mark.parametrize(
    ("level", "says"),
    [(2.0, "models-that-fit-these-data-as-well-resonate"), (2.3, "above-2-nothing-is-known-of-the-error")],
)
def test_what_the_data_leave_too_open_is_refused(level, says):
    with refused(ExtrapolationError, says):
        open_band(level)
