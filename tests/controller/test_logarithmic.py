"""The logarithmic laws: gains, bounds, anti-windup, and complex response control of a one-pole plant against scipy."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import signal
from scipy.integrate import solve_ivp

from controller.primitives import LARGEST_ERROR, log_proportional_integral, log_ratio

LOWEST, HIGHEST = 1e-4, 5.0


def _law(error, integral, kp=0.3, ki=2.0, dt=0.01, held=0):
    return log_proportional_integral(complex(error), complex(integral), complex(kp), ki, dt, LOWEST, HIGHEST, held)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_the_log_ratio_is_bounded_and_odd(wanted, measured):
    ratio = log_ratio(wanted, measured)
    assert ratio == pytest.approx(-log_ratio(measured, wanted))
    assert ratio == pytest.approx(max(-LARGEST_ERROR, min(LARGEST_ERROR, math.log(wanted / measured))))


def test_nothing_measured_or_nothing_wanted_gives_the_bound_and_never_an_infinity():
    assert log_ratio(1.0, 0.0) == LARGEST_ERROR
    assert log_ratio(1.0, math.nan) == LARGEST_ERROR
    assert log_ratio(0.0, 1.0) == -LARGEST_ERROR


def test_inside_the_bounds_it_is_the_pi_law_on_the_complex_logarithm():
    error, integral, kp, ki = 0.2 - 0.1j, -0.5 + 0.3j, 0.3 + 0.4j, 2.0
    amplitude, angle, new = _law(error, integral, kp, ki)
    assert new == pytest.approx(integral + error * ki * 0.01)
    logarithm = kp * error + new
    assert amplitude == pytest.approx(math.exp(logarithm.real))
    assert angle == pytest.approx(logarithm.imag)


complexes = st.builds(complex, st.floats(-1, 1), st.floats(-3.1, 3.1))


@given(st.lists(st.tuples(complexes, st.integers(-1, 1)), min_size=1, max_size=120), complexes)
def test_whatever_comes_the_amplitude_stays_within_its_bounds_and_the_integral_does_not_wind_up(steps, kp):
    integral, ki, dt = complex(math.log(0.1), 0.0), 20.0, 0.05
    widest = abs(kp) * abs(1 + 3.1j) + ki * dt  # how far the integral may stand beyond a bound that the sum has reached
    for error, held in steps:
        before = integral
        amplitude, angle, integral = _law(error, integral, kp, ki, dt, held)
        assert LOWEST * (1 - 1e-12) <= amplitude <= HIGHEST * (1 + 1e-12)
        assert math.isfinite(angle)
        assert math.log(LOWEST) - widest <= integral.real <= math.log(HIGHEST) + widest
        if held:
            assert (integral.real - before.real) * held <= 0.0


def test_an_integral_that_stood_at_the_limit_turns_round_at_once():
    integral = complex(math.log(0.1))
    for _ in range(10_000):
        amplitude, _, integral = _law(1.0, integral)
    assert amplitude == pytest.approx(HIGHEST)
    amplitude, _, integral = _law(-0.1, integral)
    assert amplitude < 0.98 * HIGHEST


def test_while_the_slew_limit_holds_the_output_back_the_integral_waits_but_may_turn():
    integral = complex(math.log(0.1))
    assert _law(0.5, integral, held=1)[2] == integral
    assert _law(-0.5, integral, held=1)[2].real < integral.real
    assert _law(-0.5, integral, held=-1)[2] == integral
    assert _law(0.5, integral, held=-1)[2].real > integral.real


class OnePole:
    """Complex envelope of a plant ``dA/dt = p A + b U`` at the locked frequency, sampled with a held input by scipy."""

    def __init__(self, pole, gain, dt):
        a = np.array([[pole.real, -pole.imag], [pole.imag, pole.real]])
        b = np.array([[gain.real, -gain.imag], [gain.imag, gain.real]])
        self.ad, self.bd, *_ = signal.cont2discrete((a, b, np.eye(2), np.zeros((2, 2))), dt, method="zoh")
        self.state = np.zeros(2)

    def step(self, drive):
        self.state = self.ad @ self.state + self.bd @ np.array([drive.real, drive.imag])
        return complex(*self.state)


@pytest.mark.parametrize(
    ("pole", "low_pass"), [(-11.5 + 3.9j, 2 * math.pi * 24.37 / 5), (-5.8 - 24.2j, 2 * math.pi * 149 / 5)]
)
def test_complex_response_control_cancels_the_pole_and_settles_as_a_first_order_lag_with_gain_k(pole, low_pass):
    dt, ki = 1 / 5000, low_pass / 4
    kp = ki / -pole
    plant = OnePole(pole, -pole * np.exp(0.4j), dt)  # gain of exp(0.4i) at rest
    for _ in range(5000):
        response = plant.step(0.1 + 0j)
    integral, reference, turned = complex(math.log(0.1)), 0.1 * 1.2, 0.4  # 20 % more
    amplitude, angle = 0.1, 0.0
    seen = []
    for _ in range(round(8 / ki / dt)):
        response = plant.step(amplitude * np.exp(1j * angle))
        error = complex(log_ratio(reference, abs(response)), turned - np.angle(response))
        amplitude, angle, integral = _law(error, integral, kp, ki, dt)
        seen.append(response)
    # in logarithms and to first order: the controller K (1/s - 1/p) = K (s - p)/(-p s) times the plant -p/(s - p) is K/s
    t = np.arange(1, len(seen) + 1) * dt
    log_level = np.log(np.abs(seen) / 0.1) / math.log(1.2)
    assert np.abs(log_level - (1 - np.exp(-ki * t))).max() < 0.06
    assert np.abs(np.angle(seen) - 0.4).max() < math.radians(5.0)
    assert abs(log_level[-1] - 1) < 0.02


def test_without_the_poles_gain_the_same_loop_swings():
    pole, ki, dt = -5.8 - 24.2j, 2 * math.pi * 149 / 20, 1 / 5000
    plant = OnePole(pole, -pole, dt)
    for _ in range(5000):
        response = plant.step(0.1 + 0j)
    integral, amplitude, angle, sizes = complex(math.log(0.1)), 0.1, 0.0, []
    for _ in range(round(8 / ki / dt)):
        response = plant.step(amplitude * np.exp(1j * angle))
        amplitude, angle, integral = _law(
            complex(log_ratio(0.12, abs(response)), -np.angle(response)), integral, 0.0, ki, dt
        )
        sizes.append(abs(response))
    assert max(sizes) > 1.05 * 0.12


def test_the_logarithmic_force_loop_follows_the_differential_equation_at_every_level():
    """ln U = kp E + ki int E on a force 2 U through a low-pass on its logarithm: linear, so the same at 0.01 and at 1 N."""
    kp, ki, lag, dt = 0.3, 2.0, 10.0, 1 / 5000
    step = 0.2

    def slow(_, y):  # y: log of the measured force over the start, integral of the error
        error = step - y[0]
        return [lag * (kp * error + ki * y[1] - y[0]), error]

    expected = solve_ivp(slow, (0, 4.0), [0.0, 0.0], t_eval=np.linspace(0.5, 4.0, 8), rtol=1e-8).y[0]
    for level in (0.01, 1.0):
        integral, measured = complex(math.log(level / 2.0)), math.log(level)
        got = []
        for k in range(round(4.0 / dt)):
            error = log_ratio(level * math.exp(step), math.exp(measured))
            amplitude, _, integral = _law(error, integral, kp, ki, dt)
            measured += -math.expm1(-lag * dt) * (math.log(2.0 * amplitude) - measured)
            if (k + 1) % 2500 == 0:
                got.append(measured - math.log(level))
        np.testing.assert_allclose(got, expected, atol=2e-3)
