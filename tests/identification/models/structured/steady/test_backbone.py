"""Backbones of structured models against frequency responses, closed forms and single vibrations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import IdentificationError, backbone, frequency_response, steady_state
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import BoucWen, Jenkins, Masing
from tests.identification.models.pnlss.steady.oscillators import shaker
from tests.identification.models.structured.steady.beams import beam, friction, hysteresis, smooth
from tests.refused import refused


@pytest.mark.parametrize("make", [smooth, friction, hysteresis])
@pytest.mark.parametrize("options", [{}, {"force": "fundamental", "exciter": shaker()}], ids=["sine", "coupled"])
def test_the_backbone_goes_through_the_peak_of_the_frequency_response(make, options):
    found = backbone(make(), 2.0, largest_range_use=3.0, **options)
    np.testing.assert_allclose(np.abs(found.force_n[[0, -1], 1]), [0.04, 2.0], rtol=1e-8)
    motion = found.displacement_m[:, 1, 0]
    np.testing.assert_allclose(np.degrees(np.angle(motion)), -90.0, atol=0.05)  # the residual below the band adds 0.02
    peak = frequency_response(make(), 2.0, band_hz=(22.0, 33.0), largest_range_use=3.0, **options).peak()
    assert np.abs(motion[-1]) == pytest.approx(peak.amplitude_m, rel=5e-4)
    assert found.frequency_hz[-1] == pytest.approx(peak.frequency_hz, rel=5e-4)


def test_a_point_of_the_backbone_is_a_vibration_under_its_force():
    found = backbone(smooth(), 0.5, largest_range_use=3.0)
    for k in range(1, found.count, 4):
        force_n, at_hz = float(np.abs(found.force_n[k, 1])), float(found.frequency_hz[k])
        here = replace(found, states=found.states[k:], inputs=found.inputs[k:], voltage_v=found.voltage_v[k:])
        alone = steady_state(smooth(), at_hz, force_n, near=here, largest_range_use=3.0)
        np.testing.assert_allclose(alone.outputs[0], found.outputs[k], atol=1e-5 * np.abs(found.outputs[k]).max())
        np.testing.assert_allclose(alone.multipliers[0], found.multipliers[k], rtol=1e-5)


def test_a_backbone_and_a_vibration_without_stability_are_the_same():
    asked, other = (backbone(smooth(), 0.5, largest_range_use=3.0, stability=one) for one in (True, False))
    np.testing.assert_array_equal(asked.outputs, other.outputs)
    assert np.all(np.isnan(other.multipliers))
    assert np.all(other.stable)
    at_hz = float(asked.frequency_hz[-1])
    asked, other = (steady_state(smooth(), at_hz, 0.5, largest_range_use=3.0, stability=one) for one in (True, False))
    np.testing.assert_array_equal(asked.outputs, other.outputs)
    assert np.all(np.isnan(other.multipliers))


def test_damping_of_a_slider_is_that_of_its_loop():
    stiffness, slip, scale, direction = 0.15, 0.2, 1e-3, 0.9
    slider = NonlinearElement(
        direction=[direction, 0.0], scale_m=scale, laws=(Jenkins(stiffness_n=stiffness, slip=slip),)
    )
    model = beam(slider)
    found = backbone(model, 1.0, largest_range_use=3.0)
    z = np.abs(found.displacement_m[:, 1, 0])  # the element moves as the drive point but for the second mode
    slipping = z > 1.5 * slip * scale
    assert slipping.sum() > 3
    w = 2.0 * np.pi * found.frequency_hz
    modal = 2.0 * model.damping_ratio[0] * model.omega[0] * w * z / direction**2
    loop = 4.0 * stiffness * slip * (z / scale - slip) * scale / (np.pi * z)
    force = np.abs(found.force_n[:, 1])
    np.testing.assert_allclose((modal + loop)[slipping], force[slipping], rtol=0.01)
    assert np.max(loop[slipping] / force[slipping]) > 0.05


@pytest.mark.parametrize("seed", [0, 1, 3, 4])
def test_joints_whose_sliders_slip_at_the_first_force_have_a_backbone(seed):
    """Newton's method does not find their vibration at 2 % of the force from the linear one; it begins below.

    Everywhere the force does the work that damper and sliders take: 4 F (a - F / k) for a slider of stiffness k that slips at
    F (Masing).
    """
    random, scale, direction = np.random.default_rng(seed), 1e-3, 0.9
    stiffness = 10.0 ** random.uniform(-2.0, 1.5, 18)
    law = replace(Masing(), stiffness_n=tuple(stiffness.tolist()))
    element = NonlinearElement(direction=[direction, 0.0], scale_m=scale, laws=(law,), reach=3.0)
    model = beam(element)
    found = backbone(model, 3.0, largest_range_use=3.0)
    z = np.abs(found.displacement_m[:, 1, 0])
    w = 2.0 * np.pi * found.frequency_hz
    damper = np.pi * 2.0 * model.damping_ratio[0] * model.omega[0] * w * (z / direction) ** 2
    k, strength = law.sliders()
    a = z[:, None] / scale
    joint = scale * np.sum(4.0 * strength * np.maximum(a - strength / k, 0.0), axis=1)
    force = np.pi * np.abs(found.force_n[:, 1]) * z
    np.testing.assert_allclose(damper + joint, force, rtol=0.02)
    assert np.max(joint / force) > 0.3


def test_a_backbone_with_a_hysteresis_does_the_work_that_its_loop_takes():
    law, scale, direction = BoucWen(6.0, 0.3, 1.0, -0.4), 1e-3, 0.9
    model = beam(NonlinearElement(direction=[direction, 0.0], scale_m=scale, laws=(law,), reach=3.0))
    found = backbone(model, 1.0, largest_range_use=3.0)
    z = np.abs(found.displacement_m[:, 1, 0])
    damper = (
        np.pi * 2.0 * model.damping_ratio[0] * model.omega[0] * 2.0 * np.pi * found.frequency_hz * (z / direction) ** 2
    )
    force, some = np.pi * np.abs(found.force_n[:, 1]) * z, slice(5, None, 12)
    loops = np.array([scale * _loop(law, a / scale) for a in z[some]])
    np.testing.assert_allclose(damper[some] + loops, force[some], rtol=0.02)
    assert np.max(loops / force[some]) > 0.3


def _loop(law, amplitude):
    """Area of the loop over a sine, by Wen's equation of exponent 1 from rest for twenty cycles."""

    def rates(phase, state):
        r, dx = state[0], amplitude * np.cos(phase)
        dr = law.stiffness_n * (dx - (abs(dx) * r + law.gamma * dx * abs(r)) / (law.stiffness_n * law.slip))
        return [dr, r * dx]

    cycle = 2.0 * np.pi
    found = solve_ivp(rates, (0.0, 20.0 * cycle), [0.0, 0.0], t_eval=[19.0 * cycle, 20.0 * cycle], rtol=1e-6, atol=1e-9)
    return float(np.diff(found.y[1])[0])


def test_a_backbone_begins_at_the_mode_that_is_asked_for():
    found = backbone(friction(), 2.0, near_hz=110.0, largest_range_use=3.0)
    assert 138.0 < found.frequency_hz[-1] < found.frequency_hz[0] < 150.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"force": "voltage", "exciter": shaker()},
            {"field": "force", "value": "voltage", "allowed": "pure-sine, fundamental, rms"},
        ),
        ({"largest_range_use": 0.05}, {"says": "the-backbone-ends-at-elements-are"}),
    ],
)
def test_what_has_no_backbone_is_refused(options, message):
    with refused(IdentificationError, **message):
        backbone(smooth(), 2.0, **options)
