"""Gains far beyond what a loop bears: never taken as stable again, however large they become."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from controller.tuning import (
    LARGEST_AT_HALF,
    ControlLoop,
    ForceLaw,
    FrequencyErrorLaw,
    LogForceLaw,
    PhaseLaw,
    complex_response_law,
    gains_at_half,
    unstable_poles,
)
from tests.controller.tuning.rigs import closed_loop, fluctuation, plant_of

SLOW = 2 * math.pi  # the paper's low-pass
FACTORS = np.geomspace(1.0, 1e4, 21)


def loop_of(kind, rig, lag, factor):
    """A loop of the rig whose gains of one kind are so many times moderate ones."""
    plant = plant_of(rig)
    quick = plant.frequency_rad_s / 5
    error = FrequencyErrorLaw(quick / 16)
    return {
        "phase PI": lambda: ControlLoop(plant, SLOW, PhaseLaw(2 * factor, SLOW * factor), None, lag),
        "K2": lambda: ControlLoop(plant, SLOW, PhaseLaw(2, SLOW * factor), None, lag),
        "K3 and K4": lambda: ControlLoop(plant, SLOW, PhaseLaw(2, SLOW), ForceLaw(1.5 * factor, factor), lag),
        "K2 and K4": lambda: ControlLoop(plant, SLOW, PhaseLaw(2, SLOW * factor), ForceLaw(1.5, factor), lag),
        "log force": lambda: ControlLoop(plant, quick, error, LogForceLaw(0.03 * factor, 0.2 * factor), lag),
        "response": lambda: ControlLoop(
            plant,
            quick,
            error,
            complex_response_law(plant, quick, share=0.02 * factor, smoothing_rad_s=quick, lag_deg=lag),
            lag,
        ),
        "force through response": lambda: ControlLoop(
            plant,
            quick,
            error,
            complex_response_law(
                plant, quick, share=0.2, force_share=0.01 * factor, smoothing_rad_s=quick, lag_deg=lag
            ),
            lag,
        ),
    }[kind]()


def bad(loop):
    return unstable_poles(loop) > 0 or max(gains_at_half(loop).values()) > LARGEST_AT_HALF


@pytest.mark.parametrize("rig", ["magnet-beam", "friction-beam"])
@pytest.mark.parametrize(
    "kind", ["phase PI", "K2", "K3 and K4", "K2 and K4", "log force", "response", "force through response"]
)
@pytest.mark.parametrize("lag", [-150.0, -90.0, -30.0])
def test_what_growing_gains_have_once_lost_they_never_regain(rig, kind, lag):
    found = [bad(loop_of(kind, rig, lag, factor)) for factor in FACTORS]
    lost = sum(later and not earlier for earlier, later in pairwise(found))
    regained = sum(earlier and not later for earlier, later in pairwise(found))
    # An amplitude loop may hold what the quick frequency loop alone loses: for that it needs some gain to begin with.
    assert regained <= (kind in ("log force", "response") and found[0])
    assert lost <= 1
    assert found[-1]


@pytest.mark.parametrize(
    ("k2", "k4"), [(314.0, 1.0), (6280.0, 1.0), (6280.0, 500.0), (6.28e4, 1.0), (6.28, 1e4), (6.28e4, 1e4)]
)
def test_hundred_and_thousand_times_the_papers_gains_are_bad(k2, k4):
    loop = ControlLoop(plant_of("magnet-beam"), SLOW, PhaseLaw(2.0, k2), ForceLaw(1.5, k4))
    assert bad(loop)
    assert not bad(replace(loop, frequency_law=PhaseLaw(2.0, 6.28), amplitude_law=ForceLaw(1.5, 1.0)))


@pytest.mark.parametrize(("k2", "steady"), [(6.28, True), (314.0, False), (6280.0, False)])
def test_the_simulated_loop_agrees(k2, steady):
    law = PhaseLaw(2.0, k2)
    assert bad(ControlLoop(plant_of("magnet-beam"), SLOW, law)) is not steady
    lags, _ = closed_loop("magnet-beam", SLOW, law, periods=100, offset_rad_s=0.05)
    assert (fluctuation(lags, 0.2) < math.radians(1.0)) is steady


def test_the_gain_at_half_the_frequency_is_that_of_the_loop_and_grows_with_its_gains():
    plant = plant_of("magnet-beam")
    low_pass = plant.frequency_rad_s / 5
    law = complex_response_law(plant, low_pass, force_share=0.05, smoothing_rad_s=low_pass)
    loop = ControlLoop(plant, low_pass, FrequencyErrorLaw(low_pass / 12), law)
    found = gains_at_half(loop)
    assert set(found) == {"frequency loop", "response loop", "force loop"}
    half = 0.5j * loop.omega_rad_s
    alone = replace(loop, amplitude_law=None)
    assert found["frequency loop"] >= abs(alone.frequency_loop_gain([half])[0]) * (1 - 1e-9)
    stronger = replace(loop, frequency_law=FrequencyErrorLaw(low_pass), amplitude_law=replace(law, force_per_s=3.0))
    assert gains_at_half(stronger)["frequency loop"] == pytest.approx(12 * found["frequency loop"])
    assert gains_at_half(stronger)["response loop"] == pytest.approx(found["response loop"])
    assert gains_at_half(stronger)["force loop"] == pytest.approx(found["force loop"] * 3.0 / law.force_per_s)
