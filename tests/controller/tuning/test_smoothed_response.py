"""A low-pass of the response loop's error is in its margins."""

import numpy as np

from controller.tuning import ControlLoop, FrequencyErrorLaw, complex_response_law
from tests.controller.tuning.rigs import plant_of


def loops(name="friction-beam"):
    plant = plant_of(name)
    w = plant.lock_frequency_rad_s() / 5
    laws = [complex_response_law(plant, w), complex_response_law(plant, w, smoothing_rad_s=w)]
    return w, [ControlLoop(plant, w, FrequencyErrorLaw(w / 12), law) for law in laws]


def test_the_gain_of_the_loop_falls_by_the_low_pass():
    w, (plain, smoothed) = loops()
    s = 1j * np.array([-2 * w, -0.1 * w, 0.3 * w, w])
    np.testing.assert_allclose(smoothed.amplitude_loop_gain(s), plain.amplitude_loop_gain(s) * w / (s + w), rtol=1e-12)


def test_so_do_the_rows_of_the_feedback():
    w, (plain, smoothed) = loops()
    s = 1j * np.array([0.1 * w, w])
    rows = plain.feedback(s)[:, :2] * (w / (s + w))[:, None, None]
    np.testing.assert_allclose(smoothed.feedback(s)[:, :2], rows, rtol=1e-12)
