"""How steeply a structure may harden or soften before loops that are stable on the linear plant are not."""

import math

import numpy as np
import pytest

from controller.tuning import ControlLoop, FrequencyErrorLaw, PlantModel, changes_of_hardening, hardening_margins
from tests.controller.tuning.rigs import plant_of

OMEGA = 2.0 * math.pi * 50.0
IDLE = FrequencyErrorLaw(1e-9)  # the frequency is held
PURE_FORCE = PlantModel(
    frequency_rad_s=OMEGA,
    damping_ratio=0.01,
    drive_shape=0.8,
    residual_per_kg=(0.0, 0.0),
    force_v_n=(1.0, 0.0, 0.0, 0.0),
    acceleration_v_s2_m=(0.0, 0.0, 0.0, 0.0),
    centre_rad_s=OMEGA,
    band_hz=(30.0, 80.0),
    fit_error=0.0,
    sample_rate_hz=5000.0,
    latency_samples=0.0,
)


@pytest.mark.parametrize(("lag_deg", "side"), [(-135.0, 0), (-45.0, 1)])
def test_at_a_held_force_and_frequency_the_margin_is_where_the_curve_folds(lag_deg, side):
    """Slow flow of an oscillator under a pure force: it folds where ``(D w)^2 + d^2 + kappa d = 0``, d the detuning."""
    loop = ControlLoop(PURE_FORCE, OMEGA / 5.0, IDLE, None, lag_deg)
    half_bandwidth = 0.01 * OMEGA
    detuning = OMEGA - loop.omega_rad_s
    assert (detuning > 0) == (side == 0)  # below resonance softening folds, above it hardening
    expected = (half_bandwidth**2 + detuning**2) / abs(detuning) / OMEGA
    found = hardening_margins(loop)
    assert found[side] == pytest.approx(expected, rel=0.03)
    assert found[1 - side] > 5.0 * expected


def test_at_resonance_of_a_pure_force_no_hardening_folds():
    assert min(hardening_margins(ControlLoop(PURE_FORCE, OMEGA / 5.0, IDLE))) > 1.0


def test_a_shift_moves_the_response_of_the_mode_as_another_plant_does():
    """Standing still: the amplitude at a slightly shifted mode, voltage and frequency held, from the plant itself."""
    plant = plant_of("magnet-beam")
    loop = ControlLoop(plant, OMEGA, IDLE)
    step = 1e-5 * plant.frequency_rad_s
    at = 1j * loop.omega_rad_s
    moved = [
        math.log(abs(complex(plant.at(frequency_rad_s=plant.frequency_rad_s + sign * step).acceleration_per_v(at))))
        for sign in (1.0, -1.0)
    ]
    found = complex(loop.response_after_shift(np.array([1e-6j * loop.omega_rad_s]))[0])
    assert found.real == pytest.approx((moved[0] - moved[1]) / (2.0 * step), rel=0.02)


@pytest.mark.parametrize("lag_deg", [-90.0, -60.0])
def test_what_the_plant_makes_of_slow_changes_serves_every_law_on_it(lag_deg):
    plant = plant_of("magnet-beam")
    known = changes_of_hardening(plant, lag_deg)
    for low_pass_rad_s in (20.0, 40.0):
        loop = ControlLoop(plant, low_pass_rad_s, FrequencyErrorLaw(1.0), None, lag_deg)
        np.testing.assert_allclose(loop.measured(known.s), known.deviations * loop._smoothing(known.s)[:, None, None])
        assert hardening_margins(loop, known) == hardening_margins(loop)
    other = changes_of_hardening(plant.at(frequency_rad_s=1.1 * plant.frequency_rad_s), lag_deg)
    assert hardening_margins(loop, other) != hardening_margins(loop)
