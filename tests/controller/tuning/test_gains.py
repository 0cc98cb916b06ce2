"""Designed gains: pole placement, bounds, and what the documents say of the two rigs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.tuning import (
    ControlLoop,
    ForceLaw,
    FrequencyErrorLaw,
    PhaseLaw,
    PlantModel,
    assess,
    closed_loop_poles,
    complex_response_law,
    design_phase_law,
    exact_phase_law,
    hippold_gains,
    unstable_poles,
)
from tests.controller.tuning.rigs import plant_of

OMEGA = 2 * math.pi * 24.37


def neutral_plant(decay=4.0, damping=0.004):
    """A structure behind an exciter that is a damper and nothing else: no mass, no detuning, no delay."""
    ds = damping * OMEGA
    return PlantModel(
        frequency_rad_s=OMEGA,
        damping_ratio=damping,
        drive_shape=1.0,
        residual_per_kg=(0.0, 0.0),
        force_v_n=(1.0, 0.0, 0.0, 0.0),
        # u = F + c v, c = 2 (decay - ds): the coupled mode decays with ``decay``
        acceleration_v_s2_m=(0.0, 2.0 * (decay - ds) / OMEGA, 0.0, 0.0),
        centre_rad_s=OMEGA,
        band_hz=(20.0, 30.0),
        fit_error=0.0,
        sample_rate_hz=5000.0,
        latency_samples=0.0,
    )


def test_the_closed_form_places_the_triple_pole_with_the_measured_decay_of_the_coupled_pole():
    plant, low_pass = neutral_plant(), OMEGA / 20
    assert plant.pole_offset_rad_s().real == pytest.approx(-4.0, rel=1e-3)
    gains = hippold_gains(plant, low_pass)
    assert gains.failed == ()
    triple = -low_pass * (1 + 4.0 / low_pass) / 3
    poles = closed_loop_poles(ControlLoop(plant, low_pass, gains.law))
    slow = poles[np.abs(poles) < low_pass]
    # a triple pole splits with the cube root of what the idealisation leaves out, 2 % of the plant
    np.testing.assert_allclose(slow, triple, atol=0.2 * abs(triple))
    assert np.mean(slow) == pytest.approx(triple, rel=0.03)


def test_one_plus_mu_counted_twice_does_not_place_them():
    plant, low_pass, mu = neutral_plant(), OMEGA / 20, 0.3
    right = hippold_gains(plant, low_pass).law
    dp = 4.0 * (1 + mu)
    db = dp / low_pass
    real = -(1 + db) / 3
    scale = plant.damping_ratio * OMEGA / dp / (1 + mu)
    twice = PhaseLaw(low_pass * scale * (3 * real**2 - db), low_pass**2 * scale * -(real**3))

    def spread(law):
        poles = closed_loop_poles(ControlLoop(plant, low_pass, law))
        slow = poles[np.abs(poles) < low_pass]
        return np.ptp(slow.real) + np.ptp(slow.imag)

    assert spread(twice) > 2 * spread(right)


def test_the_closed_form_says_that_the_friction_beam_is_not_for_it():
    friction, magnet = plant_of("friction-beam"), plant_of("magnet-beam")
    failed = hippold_gains(friction, friction.frequency_rad_s / 10)
    assert "145.14 Hz" in failed.failed[0]
    assert "phase neutral" in failed.failed[1]
    assert unstable_poles(ControlLoop(friction, friction.frequency_rad_s / 10, failed.law)) == 2
    assert hippold_gains(magnet, magnet.frequency_rad_s / 10).failed == ()


def test_the_exact_design_uses_up_its_sensitivity_and_no_ratio_of_gains_gives_more_integral_action():
    plant = plant_of("magnet-beam")
    low_pass = plant.frequency_rad_s / 10
    law = exact_phase_law([plant], low_pass)
    assert assess(ControlLoop(plant, low_pass, law)).frequency_margins.sensitivity_peak == pytest.approx(1.6, rel=2e-3)
    for factor in (0.5, 0.8, 1.25, 2.0):
        more = PhaseLaw(factor * law.proportional_per_s, 1.03 * law.integral_per_s2)
        assert assess(ControlLoop(plant, low_pass, more)).frequency_margins.sensitivity_peak > 1.6


def test_the_frequency_error_loop_is_that_of_a_known_plant_whatever_the_damping():
    plant = plant_of("magnet-beam")
    for damping in (0.002, 0.008):
        loop = ControlLoop(plant.at(None, damping), 30.0, FrequencyErrorLaw(3.0))
        # far below the poles, Omega' = k eps alone decides: L = k/s
        assert loop.frequency_loop_gain([0.01j])[0] == pytest.approx(3.0 / 0.01j, rel=0.02)


def test_complex_response_control_cancels_the_coupled_pole():
    plant = plant_of("friction-beam")
    low_pass = plant.frequency_rad_s / 5
    law = complex_response_law(plant, low_pass)
    loop = ControlLoop(plant, low_pass, FrequencyErrorLaw(low_pass / 12), law)
    s = 1j * np.array([-20.0, -5.0, 5.0, 20.0])
    ideal = law.integral_per_s / s * low_pass / (s + low_pass)
    np.testing.assert_allclose(loop.amplitude_loop_gain(s), ideal, rtol=0.08)


def test_the_frequency_error_loop_bears_a_mode_shape_wrong_by_half_but_not_by_twice():
    plant = plant_of("friction-beam")
    low_pass = plant.frequency_rad_s / 5
    law = complex_response_law(plant, low_pass)

    def unstable(factor):
        return unstable_poles(ControlLoop(plant, low_pass, FrequencyErrorLaw(low_pass / 12, 0.0, factor**2), law))

    assert unstable(1.5) == 0
    assert unstable(2.0) == 2


def test_the_papers_force_loop_is_lost_on_the_friction_beam_above_resonance_lag_only():
    plant = plant_of("friction-beam")
    counts = {
        lag: unstable_poles(ControlLoop(plant, 2 * math.pi, PhaseLaw(1, 10 * math.pi), ForceLaw(5, 1), lag))
        for lag in (-30.0, -90.0, -150.0)
    }
    assert counts[-30.0] == counts[-90.0] == 0
    assert counts[-150.0] > 0


def test_the_papers_gains_settle_the_magnet_beam_and_hardly_the_friction_beam():
    magnet = assess(ControlLoop(plant_of("magnet-beam"), 2 * math.pi, PhaseLaw(2, 2 * math.pi)))
    friction = assess(ControlLoop(plant_of("friction-beam"), 2 * math.pi, PhaseLaw(1, 10 * math.pi)))
    assert magnet.suited
    assert 20 <= magnet.settling.longest <= 45
    assert not friction.suited
    assert "max |S| = 3.4" in friction.reasons[0]
    assert friction.settling.longest > 74


def test_gains_that_make_the_loop_unstable_are_refused_with_the_number():
    design = assess(ControlLoop(plant_of("friction-beam"), 2 * math.pi, PhaseLaw(3, 30 * math.pi)))
    assert not design.stable
    assert not design.suited
    assert "2 pole(s)" in design.reasons[0]
    assert design.steps is None
    assert design.settling.longest == math.inf


def test_the_design_takes_the_closed_form_where_it_holds_and_the_exact_map_elsewhere():
    for name, words in (("magnet-beam", "closed form"), ("friction-beam", "exact map")):
        plant = plant_of(name)
        design = design_phase_law([plant], plant.frequency_rad_s / 10)
        assert words in design.notes[0]
        assert design.suited
        assert bool(design.failed) == (name == "friction-beam")


def test_a_plant_that_misses_its_measurement_makes_a_rig_unsuited():
    plant = replace(plant_of("magnet-beam"), fit_error=0.3)
    assert "30 %" in assess(ControlLoop(plant, 10.0, PhaseLaw(0.1, 1.0))).reasons[0]
