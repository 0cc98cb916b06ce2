"""Frequency responses of structured models: folds, stability, exciters, notes."""

from dataclasses import replace

import numpy as np
import pytest

from identification import (
    frequency_response,
    harmonic_response,
    steady_state,
)
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import Jenkins, PolynomialSpring
from tests.identification.models.pnlss.steady.oscillators import level, shaker
from tests.identification.models.structured.steady.beams import beam, friction, smooth


def duffing(cubic_n: float = 6.0):
    spring = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(PolynomialSpring((0.0, cubic_n)),))
    return beam(spring)


def test_the_response_turns_at_two_folds_where_a_multiplier_is_one():
    found = harmonic_response(duffing(), 1.0, band_hz=(22.0, 35.0), largest_range_use=3.0)
    assert found.complete
    assert found.folds.count == 2
    for each in found.folds.multipliers:
        assert np.min(np.abs(each - 1.0)) < 1e-3
    assert found.folds.frequency_hz[0] > found.folds.frequency_hz[1] + 0.5
    stable = found.points.stable
    changes = np.flatnonzero(np.diff(stable.astype(int)))
    assert stable[[0, -1]].all()
    assert changes.size == 2
    np.testing.assert_allclose(found.points.frequency_hz[changes], found.folds.frequency_hz, rtol=2e-3)
    assert set(np.array(found.points.loss)[~stable]) == {"fold"}


def test_a_weak_cubic_spring_bends_the_resonance_as_the_first_order_says():
    cubic_n, scale, b = 0.6, 1e-3, 0.9
    model = duffing(cubic_n)
    peak = frequency_response(model, 0.4, band_hz=(24.0, 26.0), largest_range_use=3.0).peak()
    omega, zeta, direction = model.omega[0], model.damping_ratio[0], 0.9
    amplitude = b * 0.4 / (2.0 * zeta * omega**2)  # of q, the velocity is in phase with the force
    cubic = cubic_n * direction**4 / scale**3
    detuned = omega * (1.0 + 0.375 * cubic * amplitude**2 / omega**2)
    assert detuned / omega - 1.0 > 2e-3
    assert peak.frequency_hz == pytest.approx(detuned / (2.0 * np.pi), rel=3e-4)
    assert peak.amplitude_m == pytest.approx(b * amplitude, rel=0.01)


def test_friction_makes_a_kink_in_the_response_that_the_path_crosses():
    slider = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(Jenkins(stiffness_n=3.0, slip=0.2),))
    found = harmonic_response(beam(slider), 1.0, band_hz=(22.0, 30.0), largest_range_use=3.0)
    assert found.complete
    assert found.points.stable.all()
    amplitude = np.abs(found.points.displacement_m[:, 1, 0])
    assert amplitude.min() < 0.2e-3 < 2.0 * 0.2e-3 < amplitude.max()
    stuck_hz = np.sqrt(beam().omega[0] ** 2 + 3.0 * 0.9**2 / 1e-3) / (2.0 * np.pi)
    assert 25.0 < found.prediction.peak().frequency_hz < stuck_hz
    at_hz = float(found.points.frequency_hz[np.argmax(amplitude)])
    alone = steady_state(beam(slider), at_hz, 1.0, largest_range_use=3.0)
    assert np.abs(alone.displacement_m[0, 1, 0]) == pytest.approx(amplitude.max(), rel=1e-6)


@pytest.mark.parametrize("held", ["fundamental", "rms", "voltage"])
@pytest.mark.parametrize("make", [smooth, friction])
def test_the_exciter_makes_the_force_that_its_equation_gives(make, held):
    found = harmonic_response(make(), **level(1.5, held), exciter=shaker(), band_hz=(22.0, 28.0), largest_range_use=3.0)
    assert found.complete
    points, h = found.points, np.arange(1, 8)
    held_level = {
        "fundamental": np.abs(points.force_n[:, 1]),
        "rms": np.sqrt(0.5 * np.sum(np.abs(points.force_n[:, 1:]) ** 2, axis=1)),
        "voltage": np.abs(points.voltage_v),
    }[held]
    np.testing.assert_allclose(held_level, 1.5, rtol=1e-8)
    for k in range(0, points.count, 10):
        motion = make().direct[0, 0] * points.force_n[k, 1:]
        acceleration = points.outputs[k, 1:, 0]
        assert np.linalg.norm(motion) < 0.1 * np.linalg.norm(acceleration)
        voltage = np.where(h == 1, points.voltage_v[k], 0.0)
        force = shaker().force(voltage, acceleration, h * points.frequency_hz[k])
        np.testing.assert_allclose(points.force_n[k, 1:], force, atol=1e-7)


def test_a_vibration_near_another_one_is_the_same_as_that_from_rest():
    model = smooth()
    first = steady_state(model, 24.0, 1.0, largest_range_use=3.0)
    near = steady_state(model, 24.2, 1.0, near=first, largest_range_use=3.0)
    alone = steady_state(model, 24.2, 1.0, largest_range_use=3.0)
    np.testing.assert_allclose(near.outputs, alone.outputs, atol=1e-6)
    assert near.stable[0]


def test_notes_say_what_is_held_and_what_is_extrapolated():
    found = harmonic_response(duffing(0.5), 3.0, band_hz=(22.0, 32.0), largest_range_use=3.0)
    assert "held: a force without harmonics" in found.notes
    assert any("reach of their laws" in note for note in found.notes)
    assert np.max(found.prediction.range_use) > 1.0
    assert not any("training data" in note for note in found.notes)
    short = harmonic_response(duffing(0.5), 3.0, largest_range_use=0.5, band_hz=(22.0, 32.0))
    assert not short.complete
    assert any("beyond 0.5 times" in note for note in short.notes)


def test_the_range_is_that_of_the_training_data_if_it_is_known():
    model = duffing(0.5)
    (element,) = model.elements
    known = replace(model, elements=(replace(element, largest=0.5 * element.reach),))
    options = {"band_hz": (22.0, 32.0), "largest_range_use": 10.0}
    one, other = (harmonic_response(each, 3.0, **options) for each in (model, known))
    assert np.max(other.prediction.range_use) == pytest.approx(2.0 * np.max(one.prediction.range_use))
    assert any("times the training data" in note for note in other.notes)


def test_the_default_band_is_that_of_the_mode_that_moves_most():
    found = frequency_response(beam(), 0.1, largest_range_use=3.0)
    assert (found.frequency_hz.min(), found.frequency_hz.max()) == pytest.approx((0.85 * 25.0, 1.15 * 25.0))
    assert found.peak().frequency_hz == pytest.approx(25.0, rel=1e-3)


def test_the_default_band_of_a_joint_is_that_of_the_stuck_structure():
    model = friction()
    stiffness = np.diag(model.omega**2)
    for element in model.elements:
        stiffness += np.outer(element.phi, element.phi) * np.sum(element.sliders(element.laws)[:, 0])
    stuck_hz = np.sqrt(np.linalg.eigvalsh(stiffness)[0]) / (2.0 * np.pi)
    assert stuck_hz > 1.03 * 25.0
    found = frequency_response(model, 0.001, largest_range_use=3.0)
    assert (found.frequency_hz.min(), found.frequency_hz.max()) == pytest.approx((0.85 * stuck_hz, 1.15 * stuck_hz))
    assert found.peak().frequency_hz == pytest.approx(stuck_hz, rel=1e-3)


def test_the_support_acts_with_an_exciter_and_where_it_is_asked_for():
    mean = {
        support: steady_state(smooth(), 24.0, 1.0, support=support, largest_range_use=3.0).outputs[0, 0, 2].real
        for support in (None, False, True)
    }
    assert mean[None] == mean[False]
    assert abs(mean[True]) < 0.99 * abs(mean[False])
    coupled = {
        support: steady_state(
            smooth(), 24.0, 1.0, force="fundamental", exciter=shaker(), support=support, largest_range_use=3.0
        )
        for support in (None, False, True)
    }
    np.testing.assert_array_equal(coupled[None].outputs, coupled[True].outputs)
    assert coupled[True].outputs[0, 0, 2].real == pytest.approx(mean[True], rel=0.01)
    assert coupled[False].outputs[0, 0, 2].real == pytest.approx(mean[False], rel=0.01)
