"""The windows of a hammer test, against what is known of each of their samples."""

import numpy as np
import pytest

from identification.hammer.hits import Pulse
from identification.hammer.windows import decay_rate, exponential_window, force_window

RATE_HZ, SAMPLES = 500.0, 400
PULSE = Pulse(20, 23, 28, 90.0)  # 8 samples
QUARTERS = [0.5 * (1.0 - np.cos(np.pi * part)) for part in (0.25, 0.5, 0.75)]


@pytest.mark.parametrize(
    ("pulse", "length", "rise", "fall"),
    [
        (PULSE, None, (11, 19), (52, 60)),  # one width before the pulse, four after it
        (PULSE, 30, (11, 19), (42, 50)),
        (PULSE, 2, (11, 19), (20, 28)),  # it never ends within the pulse
        (Pulse(20, 21, 22, 90.0), None, (15, 19), (34, 38)),  # the edges have four samples at least
    ],
)
def test_a_force_window_is_one_around_the_pulse_with_half_a_cosine_at_either_end(pulse, length, rise, fall):
    window = force_window(SAMPLES, pulse, length)
    assert window.shape == (SAMPLES,)
    np.testing.assert_array_equal(window[: rise[0] + 1], 0.0)
    np.testing.assert_array_equal(window[rise[1] : fall[0] + 1], 1.0)
    np.testing.assert_array_equal(window[fall[1] :], 0.0)
    step = (rise[1] - rise[0]) // 4
    np.testing.assert_allclose(window[rise[0] + step : rise[1] : step], QUARTERS, rtol=1e-12)
    np.testing.assert_allclose(window[fall[0] + step : fall[1] : step], QUARTERS[::-1], rtol=1e-12)


def test_an_exponential_window_falls_to_its_eth_part_in_one_over_its_rate():
    window = exponential_window(SAMPLES, 4.0, RATE_HZ)
    assert (window[0], window.shape) == (1.0, (SAMPLES,))
    np.testing.assert_allclose(window[125], np.exp(-1.0), rtol=1e-12)  # 0.25 s
    np.testing.assert_allclose(window[1:] / window[:-1], np.exp(-0.008), rtol=1e-12)


def motions(left, noise, hits=3):
    """float[hits, channels, SAMPLES]: of mean square ``1 + noise^2`` first and ``left^2 + noise^2`` at the end, by channel.

    The hits differ in size; in their mean they are as it says.
    """
    envelope = np.where(np.arange(SAMPLES) < SAMPLES // 2, 1.0, np.asarray(left)[:, None])
    sizes = np.sqrt(np.arange(1, hits + 1) * 2.0 / (hits + 1))  # mean square 1
    power = (sizes[:, None, None] * envelope) ** 2 + np.asarray(noise)[:, None] ** 2
    return np.sqrt(power) * (-1.0) ** np.arange(SAMPLES)


@pytest.mark.parametrize(
    ("left", "noise", "decides"),
    [((0.1,), (0.0,), 0.1), ((0.02, 0.3), (0.0, 0.0), 0.3), ((0.2, 0.05), (0.1, 0.7), 0.2)],
)
def test_the_window_leaves_a_hundred_thousandth_of_the_motion_that_lasts_longest_without_its_noise(
    left, noise, decides
):
    rate_1_s = decay_rate(motions(left, noise), np.array(noise), RATE_HZ)
    assert decides * np.exp(-rate_1_s * SAMPLES / RATE_HZ) == pytest.approx(1e-5, rel=1e-9)


@pytest.mark.parametrize("left", [1e-6, 0.0])
def test_a_motion_that_ends_by_itself_needs_no_window(left):
    assert decay_rate(motions((left,), (0.0,)), np.zeros(1), RATE_HZ) == 0.0
