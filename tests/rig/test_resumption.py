"""By how much the output jumps when outputs come again: the bounds on the protocol's page, by closed forms."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rig.continuation import STEPS, period_steps
from tests.rig.test_continuation import CUBIC, RATE_HZ, Device

AMPLITUDE = 2.0**24
SAMPLES = np.arange(1, 1000)  # of lateness: up to 0.2 s


def jumps(
    wave: Callable[[np.ndarray], np.ndarray], frequency_hz: Callable[[float], float], end: int, block: int = 10
) -> np.ndarray:
    """What the host means less what the device puts out, at each sample after ``end``; times are in seconds from there."""
    device = Device(2048)
    for first in range(0, end, block):
        outputs = np.rint(wave((np.arange(first, first + block) - end) / RATE_HZ))
        device.keep(first, outputs, period_steps(RATE_HZ / frequency_hz((first + block - end) / RATE_HZ)))
    got = np.array([device.at(end + int(k)) for k in SAMPLES], float)
    return np.abs(wave(SAMPLES / RATE_HZ) - got)


def rule_error(frequency_hz: float) -> float:
    """Share of the amplitude: the cubic, the cut of a peak between two samples, the period's last half step."""
    omega = 2.0 * math.pi * frequency_hz / RATE_HZ
    periods = SAMPLES[-1] * frequency_hz / RATE_HZ + 2.0
    return CUBIC * omega**4 + omega**2 / 8.0 + periods * omega / (2.0 * STEPS)


@pytest.mark.parametrize("rate_hz_s", [1.0, -1.0, 5.0])
@pytest.mark.parametrize("frequency_hz", [23.0, 149.0])
def test_a_sweep_is_off_by_pi_a_t_squared(frequency_hz: float, rate_hz_s: float) -> None:
    def wave(t: np.ndarray) -> np.ndarray:
        return AMPLITUDE * np.sin(2.0 * math.pi * (frequency_hz * t + 0.5 * rate_hz_s * t**2) + 0.7)

    off = jumps(wave, lambda t: frequency_hz + rate_hz_s * t, 1500)
    longest_s = np.maximum(SAMPLES / RATE_HZ, 1.0 / frequency_hz)
    fastest_hz = frequency_hz + abs(rate_hz_s)
    assert (off <= AMPLITUDE * (math.pi * abs(rate_hz_s) * longest_s**2 + rule_error(fastest_hz)) + 2.0).all()
    if rate_hz_s == 1.0:
        late = SAMPLES <= 0.1 * RATE_HZ
        degrees = math.degrees(math.pi * 0.1**2)
        assert degrees == pytest.approx(1.8)
        assert off[late].max() <= AMPLITUDE * (math.radians(degrees) + rule_error(fastest_hz)) + 2.0


@pytest.mark.parametrize("share_s", [0.2, -0.2, 1.0])
@pytest.mark.parametrize("frequency_hz", [23.0, 149.0])
def test_an_amplitude_on_its_way_is_off_by_its_rate_times_the_time_and_a_period(
    frequency_hz: float, share_s: float
) -> None:
    def wave(t: np.ndarray) -> np.ndarray:
        return AMPLITUDE * (1.0 + share_s * t) * np.sin(2.0 * math.pi * frequency_hz * t)

    off = jumps(wave, lambda _: frequency_hz, 1500)
    rate_s = AMPLITUDE * abs(share_s)
    largest = AMPLITUDE * (1.0 + abs(share_s))
    assert (off <= rate_s * (SAMPLES / RATE_HZ + 1.0 / frequency_hz) + largest * rule_error(frequency_hz) + 2.0).all()


@pytest.mark.parametrize("step_deg", [1.0, 10.0, 90.0])
def test_a_step_of_phase_comes_late_as_it_is(step_deg: float) -> None:
    frequency_hz, step = 149.0, math.radians(step_deg)

    def wave(t: np.ndarray) -> np.ndarray:
        return AMPLITUDE * np.sin(2.0 * math.pi * frequency_hz * t + step * (t >= 0.0))

    off = jumps(wave, lambda _: frequency_hz, 1500)
    assert (off <= AMPLITUDE * (2.0 * math.sin(0.5 * step) + rule_error(frequency_hz)) + 2.0).all()


def test_harmonics_that_change_are_off_by_their_change() -> None:
    """Coefficients of the harmonics loop that go on while the host is late: each by its rate times the time and a period."""
    frequency_hz, third_s, fifth_s = 149.0, 0.5, 0.3
    omega = 2.0 * math.pi * frequency_hz

    def wave(t: np.ndarray) -> np.ndarray:
        third, fifth = (0.10 + third_s * t) * np.sin(3 * omega * t), (0.05 + fifth_s * t) * np.cos(5 * omega * t)
        return AMPLITUDE * (np.sin(omega * t) + third + fifth)

    off = jumps(wave, lambda _: frequency_hz, 1500)
    change = (third_s + fifth_s) * (SAMPLES / RATE_HZ + 1.0 / frequency_hz)
    per_sample = omega / RATE_HZ
    cubic = CUBIC * per_sample**4 * (1.0 + 81 * 0.3 + 625 * 0.2)
    cut = per_sample**2 / 8.0 * (1.0 + 9 * 0.3 + 25 * 0.2)
    drift = 32 * per_sample / (2.0 * STEPS) * (1.0 + 3 * 0.3 + 5 * 0.2)
    assert (off <= AMPLITUDE * (change + cubic + cut + drift) + 2.0).all()
