import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from identification import Channel, IdentificationError, demodulate
from tests.refused import refused

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"))
RATE_HZ = 5000.0


def linear_sweep(start_hz: float, rate_hz_s: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    return time, 2 * np.pi * (start_hz * time + 0.5 * rate_hz_s * time**2)


@settings(max_examples=25, deadline=None)
@given(
    start_hz=st.floats(10.0, 200.0),
    rate_hz_s=st.floats(-5.0, 15.0),
    phase=st.floats(-3.0, 3.0),
    periods=st.integers(1, 3),
)
def test_constant_harmonics_and_an_offset_do_not_touch_the_fundamental_of_a_chirp(
    start_hz: float, rate_hz_s: float, phase: float, periods: int
) -> None:
    _, theta = linear_sweep(start_hz, rate_hz_s, 1.0)
    signal = 2.0 * np.cos(theta + phase) + 5.0 + 3.0 * np.cos(2 * theta + 1.0) + 1.5 * np.sin(3 * theta)
    result = demodulate(theta, [signal, -signal], CHANNELS, sample_rate_hz=RATE_HZ, periods=periods)
    # Splines through 24 samples per period at the least.
    np.testing.assert_allclose(result.force, 2.0 * np.exp(1j * phase), atol=4e-3)
    np.testing.assert_allclose(result.fundamental("drive"), -result.force, atol=1e-12)


def test_a_wrapped_phase_in_single_precision_is_as_good() -> None:
    _, theta = linear_sweep(10.0, 7.5, 4.0)
    signal = np.cos(theta + 0.5)
    wrapped = np.mod(theta, 2 * np.pi).astype(np.float32)
    result = demodulate(wrapped, [signal, signal], CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.force, np.exp(0.5j), atol=1e-5)


def test_momentary_frequency_of_a_linear_sweep_is_exact() -> None:
    _, theta = linear_sweep(10.0, 7.5, 4.0)
    result = demodulate(theta, [np.cos(theta)] * 2, CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.frequency_hz, 10.0 + 7.5 * result.time_s, atol=1e-5)


def test_a_long_record_is_as_good_everywhere_and_takes_little_memory() -> None:
    _, theta = linear_sweep(20.0, 0.2, 60.0)
    signal = 2.0 * np.cos(theta + 0.5) + 3.0 * np.cos(2 * theta)
    tracemalloc.start()
    result = demodulate(theta, [signal, signal], CHANNELS, sample_rate_hz=RATE_HZ)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_allclose(result.force, 2.0 * np.exp(0.5j), atol=1e-4)
    assert peak_bytes < 200 * theta.size


@pytest.mark.parametrize("periods", [1, 2, 4])
def test_a_modulation_passes_with_the_gain_of_the_triangle_and_without_delay(periods: int) -> None:
    carrier_hz, modulation_hz = 25.0, 4.0
    time, theta = linear_sweep(carrier_hz, 0.0, 5.0)
    signal = (1.0 + 0.3 * np.cos(2 * np.pi * modulation_hz * time)) * np.cos(theta)
    result = demodulate(theta, [signal] * 2, CHANNELS, sample_rate_hz=RATE_HZ, periods=periods)
    gain = np.sinc(periods * modulation_hz / carrier_hz) ** 2
    expected = 1.0 + 0.3 * gain * np.cos(2 * np.pi * modulation_hz * result.time_s)
    # The mirror image at twice the carrier, off the zeros of the triangle by the modulation.
    image = 0.15 * sum(np.sinc(periods * (2 * carrier_hz + s * modulation_hz) / carrier_hz) ** 2 for s in (-1, 1))
    assert np.max(np.abs(result.force - expected)) <= 1.05 * image + 1e-5


def test_a_linear_oscillator_swept_slowly_follows_its_frequency_response() -> None:
    # q'' + 2 D w q' + w^2 q = cos(theta), integrated to 1e-10; quasi-static up to the sweep rate over (D w)^2.
    w, damping, rate_hz_s = 2 * np.pi * 24.0, 0.05, 0.5
    time, theta = linear_sweep(20.0, rate_hz_s, 16.0)

    def motion(t: float, x: np.ndarray) -> list[float]:
        drive = np.cos(2 * np.pi * (20.0 * t + 0.5 * rate_hz_s * t**2))
        return [x[1], drive - 2 * damping * w * x[1] - w**2 * x[0]]

    solution = solve_ivp(motion, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-13, method="DOP853")
    channels = (Channel("force", "force", "N"), Channel("drive", "drive", "m"))
    result = demodulate(theta, [np.cos(theta), solution.y[0]], channels, sample_rate_hz=RATE_HZ)
    settled = result.time_s > 2.0
    omega = 2 * np.pi * result.frequency_hz[settled]
    expected = 1.0 / (w**2 - omega**2 + 2j * damping * w * omega)
    lag = 2 * np.pi * rate_hz_s / (damping * w) ** 2  # rad, how far the response lags behind the quasi-static one
    error = np.abs(result.fundamental("drive")[settled] - expected) / np.max(np.abs(expected))
    assert error.max() < 1.2 * lag
    assert lag < 0.06


def test_only_whole_windows_are_given() -> None:
    _, theta = linear_sweep(25.0, 0.0, 1.0)
    result = demodulate(theta, [np.cos(theta)] * 2, CHANNELS, sample_rate_hz=RATE_HZ, periods=3, every=1)
    assert result.time_s[0] == pytest.approx(3 / 25.0)
    assert result.time_s[-1] == pytest.approx(1.0 - 1 / RATE_HZ - 3 / 25.0, abs=1.01 / RATE_HZ)
    assert result.window_periods == 6
    assert np.diff(result.time_s) == pytest.approx(1 / RATE_HZ)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"theta_rad": np.linspace(0.0, 10.0, 800)},
            {"says": "covers-periods-2", "field": "theta_rad", "allowed": "3 with periods = 1"},
        ),
        ({"theta_rad": np.linspace(0.0, 700.0, 800)}, {"says": "samples-in-the-shortest-period", "field": "theta_rad"}),
        ({"theta_rad": np.linspace(10.0, 0.0, 800)}, {"says": "does-not-rise-from-to-2", "field": "theta_rad"}),
        ({"periods": 0}, {"field": "periods", "value": 0, "allowed": "1 and above"}),
        ({"every": 0}, {"field": "every", "value": 0, "allowed": "at least 1"}),
        (
            {"samples": np.zeros((1, 800))},
            {"says": "shape-6", "field": "samples", "allowed": "(2, 800): channels by samples of theta_rad"},
        ),
        ({"samples": np.full((2, 800), np.nan)}, {"says": "value-at-is-nan-2", "field": "samples"}),
    ],
)
def test_what_cannot_be_demodulated_is_named(change: dict[str, object], message: str) -> None:
    arguments = {"theta_rad": np.linspace(0.0, 60.0, 800), "samples": np.zeros((2, 800))} | change
    theta, samples = arguments.pop("theta_rad"), arguments.pop("samples")
    with refused(IdentificationError, **message):
        demodulate(theta, samples, CHANNELS, sample_rate_hz=RATE_HZ, **arguments)
