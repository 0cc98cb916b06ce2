"""What the linearised loop predicts, against plain simulations in time."""

import math

import numpy as np
import pytest

from controller.tuning import (
    ComplexResponseLaw,
    ControlLoop,
    FrequencyErrorLaw,
    PhaseLaw,
    assess,
    complex_response_law,
    exact_phase_law,
    hippold_gains,
    step_response,
)
from controller.tuning.loop import envelope
from tests.controller.tuning.rigs import RATE_HZ, closed_loop, fluctuation, periodic_state, plant_of, sampled


def modulated_lag(name, slow_rad_s, deviation_rad_s):
    """Complex amplitude of the lag (rad) under ``Omega = deviation cos(slow t)``, from a simulation of the linear rig."""
    rate_hz = 4 * RATE_HZ  # the images of a voltage held for longer are 2 % of the friction beam's force at resonance
    (transition, column, rows), dt = sampled(name, rate_hz), 1 / rate_hz
    omega = plant_of(name).lock_frequency_rad_s()
    n = round(6 * 2 * math.pi / slow_rad_s / dt)
    time = dt * np.arange(n)
    theta = omega * time + deviation_rad_s / slow_rad_s * np.sin(slow_rad_s * time)
    state, out = periodic_state(name, omega, rate_hz), np.empty((n, 2))
    for i, u in enumerate(np.cos(theta)):
        out[i] = rows @ state
        state = transition @ state + column * u
    # envelopes by a mean over whole periods, centred and so without delay
    width = round(2 * math.pi / omega / dt)
    window = np.convolve(np.ones(width), np.ones(width)) / width**2
    turned = 2 * out * np.exp(-1j * omega * time)[:, None]
    force, response = (np.convolve(channel, window, mode="same") for channel in turned.T)
    lag = np.unwrap(np.angle(force / response))
    last = slice(n // 2, n - 2 * width)
    basis = np.stack([np.ones(n), np.cos(slow_rad_s * time), np.sin(slow_rad_s * time)], axis=1)[last]
    _, real, minus_imag = np.linalg.lstsq(basis, lag[last], rcond=None)[0]
    smoothing = np.sum(window * np.cos(slow_rad_s * dt * (np.arange(window.size) - width + 1)))
    return (real - 1j * minus_imag) / deviation_rad_s / smoothing


@pytest.mark.parametrize(("name", "slow"), [("magnet-beam", (4.0, 12.0)), ("friction-beam", (8.0, 25.0, 70.0))])
def test_the_map_from_frequency_to_lag_is_that_of_a_small_modulation(name, slow):
    for slow_rad_s in slow:
        plant, s = plant_of(name), np.array([1j * slow_rad_s])
        force, response = (
            envelope(of, s, plant.lock_frequency_rad_s())[0] for of in (plant.force_per_v, plant.acceleration_per_v)
        )
        predicted = ((force - response) / s)[0] * np.exp(-0.125j * slow_rad_s / RATE_HZ)  # the hold
        assert modulated_lag(name, slow_rad_s, 0.02) == pytest.approx(predicted, rel=0.02)


def loops():
    friction, magnet = plant_of("friction-beam", held=True), plant_of("magnet-beam", held=True)
    fast, slow = friction.frequency_rad_s / 5, magnet.frequency_rad_s / 5
    return {
        "the paper's, friction beam": ("friction-beam", 2 * math.pi, PhaseLaw(1, 10 * math.pi), None),
        "frequency error and complex response, friction beam": (
            "friction-beam",
            fast,
            FrequencyErrorLaw(fast / 12),
            complex_response_law(friction, fast),
        ),
        "frequency error and complex response, magnet beam": (
            "magnet-beam",
            slow,
            FrequencyErrorLaw(slow / 8),
            complex_response_law(magnet, slow),
        ),
    }


@pytest.mark.parametrize("name", loops())
def test_the_loop_is_stable_below_its_gain_margin_and_unstable_above(name):
    rig, low_pass, law, amplitude_law = loops()[name]
    plant = plant_of(rig, held=True)
    margin = assess(ControlLoop(plant, low_pass, law, amplitude_law)).frequency_margins.gain_margin
    start = 0.1 * plant.damping_ratio * plant.frequency_rad_s
    for share, dies in ((0.8, True), (1.25, False)):
        lags, _ = closed_loop(rig, low_pass, law, amplitude_law, periods=300, offset_rad_s=start, factor=share * margin)
        first, last = np.std(lags[: lags.size // 4]), fluctuation(lags, 0.25)
        assert (last < 0.5 * first) == dies
        assert (last > 2.0 * first) != dies


def test_the_closed_form_keeps_the_friction_beam_swinging():
    plant = plant_of("friction-beam", held=True)
    low_pass = plant.frequency_rad_s / 10
    lags, _ = closed_loop("friction-beam", low_pass, hippold_gains(plant, low_pass).law, periods=300, offset_rad_s=0.1)
    assert math.degrees(fluctuation(lags, 0.5)) > 10.0


def test_the_growth_of_an_unstable_loop_is_that_of_its_pole():
    plant, law = plant_of("friction-beam", held=True), PhaseLaw(1.8, 18 * math.pi)
    poles = assess(ControlLoop(plant, 2 * math.pi, law)).poles_rad_s
    fastest = poles[np.argmax(poles.real)]
    lags, _ = closed_loop("friction-beam", 2 * math.pi, law, periods=220, offset_rad_s=0.002)
    n = round(2 * math.pi / abs(fastest.imag) * RATE_HZ)
    swings = [np.ptp(lags[i : i + n]) for i in (lags.size - 3 * n, lags.size - n)]
    assert math.log(swings[1] / swings[0]) / (2 * n / RATE_HZ) == pytest.approx(fastest.real, rel=0.1)


@pytest.mark.parametrize("name", ["magnet-beam", "friction-beam"])
def test_the_lag_after_a_step_of_the_wanted_lag_is_the_simulated_one(name):
    plant = plant_of(name, held=True)
    low_pass = plant.frequency_rad_s / 10
    law = exact_phase_law([plant], low_pass)
    loop = ControlLoop(plant, low_pass, law)
    periods, step_rad = 60, math.radians(2.0)
    lags, _ = closed_loop(name, low_pass, law, periods=periods, target_step_rad=step_rad)
    time, predicted = step_response(loop.lag_after_target, periods * 2 * math.pi / plant.frequency_rad_s)
    measured = np.interp(time, np.arange(lags.size) / RATE_HZ, (lags + math.pi / 2) / step_rad)
    np.testing.assert_allclose(measured[:-10], predicted[:-10], atol=0.1)
    assert np.sqrt(np.mean((measured - predicted)[:-10] ** 2)) < 0.02


def test_a_step_response_is_that_of_the_closed_form():
    time, response = step_response(lambda s: 50.0 * np.exp(-0.02 * s) / ((s + 1.0) * (s + 50.0)), 8.0)
    late = np.maximum(time - 0.02, 0.0)
    exact = 1.0 - (50.0 * np.exp(-late) - np.exp(-50.0 * late)) / 49.0
    np.testing.assert_allclose(response, exact, atol=1e-4)


def test_complex_response_control_with_a_real_gain_swings_on_the_friction_beam():
    plant = plant_of("friction-beam", held=True)
    low_pass = plant.frequency_rad_s / 5
    law, right = FrequencyErrorLaw(low_pass / 12), complex_response_law(plant, low_pass)
    wrong = ComplexResponseLaw(right.proportional.real, right.integral_per_s)
    for amplitude_law, dies in ((right, True), (wrong, False)):
        assert assess(ControlLoop(plant, low_pass, law, amplitude_law)).stable == dies
        lags, _ = closed_loop("friction-beam", low_pass, law, amplitude_law, periods=300, offset_rad_s=0.1)
        assert (fluctuation(lags, 0.25) < math.radians(0.1)) == dies


def test_what_lies_above_the_highest_frequency_is_neither_evaluated_nor_in_the_step_response():
    """A loud line where the transfer function is faded to 1 %, and none of it asked for where it is faded out."""
    highest, line = 200.0, 270.0

    def transfer(s):
        assert s.imag.max() <= 1.5 * highest
        return 10.0 / (s + 10.0) + 100.0 * np.exp(-(((s.imag - line) / 5.0) ** 2))

    time, response = step_response(transfer, 2.0, highest_rad_s=highest)
    faded = math.sin(0.25 * math.pi * (3.0 - 2.0 * line / highest)) ** 2
    loudest = 2.0 / math.pi * math.sqrt(math.pi) * 5.0 * 100.0 / line  # at 0 s, of the line as it comes
    ringing = np.abs(response - 1.0 + np.exp(-10.0 * time))[time < 0.3].max()
    assert ringing < 3.0 * faded * loudest + 0.1
    assert ringing < 0.5 * loudest
