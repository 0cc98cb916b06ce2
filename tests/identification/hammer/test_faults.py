"""Double hits within one pulse of the force, on forces whose tops and valleys are known sample by sample."""

import numpy as np
import pytest

from identification.hammer.faults import double_hit
from identification.hammer.hits import Pulse

RATE_HZ = 1000.0
FIRST, END, SAMPLES = 10, 60, 400


def told(tops, valley_n):
    """What is said of straight lines from 0 N over two tops (sample, height) with a valley half way between them."""
    (early, early_n), (late, late_n) = tops
    force = np.interp(
        np.arange(float(SAMPLES)),
        [FIRST - 1, early, 0.5 * (early + late), late, END],
        [0.0, early_n, valley_n, late_n, 0.0],
    )
    peak, height_n = max(tops, key=lambda top: top[1])
    return double_hit(force, Pulse(FIRST, peak, END, height_n), (), 0.0, RATE_HZ)


def test_a_second_top_within_the_pulse_is_told_with_its_height_and_its_distance():
    assert told([(20, 100.0), (44, 60.0)], 20.0) == "double hit: another one of 60 N (60 %) 24 ms later"
    assert told([(26, 40.0), (40, 80.0)], 10.0) == "double hit: another one of 40 N (50 %) 14 ms before"


@pytest.mark.parametrize(("valley_n", "hit"), [(25.0, True), (30.0, True), (35.0, False), (55.0, False)])
def test_a_second_top_is_a_hit_from_a_valley_of_half_its_height_on(valley_n, hit):
    assert bool(told([(20, 100.0), (44, 60.0)], valley_n)) is hit


WIDE = Pulse(100, 120, 142, 100.0)
"""A pulse of 42 samples: what follows it is averaged over 21, from 21 samples after its end on."""


def followed_by(further, noise_n=0.0):
    """What is said of a pulse, and of what follows it, where the force is known to have this noise."""
    force = np.interp(np.arange(4000.0), [99, 120, 142], [0.0, 100.0, 0.0])
    return double_hit(force + further, WIDE, (), noise_n, 1e5)


def flat(height_n, first, samples=31):
    return np.where((np.arange(4000) >= first) & (np.arange(4000) < first + samples), height_n, 0.0)


@pytest.mark.parametrize(("height_n", "hit"), [(2.9, False), (3.1, True)])
def test_a_later_pulse_is_a_hit_from_three_percent_of_the_first_on(height_n, hit):
    assert bool(followed_by(flat(height_n, 600))) is hit


@pytest.mark.parametrize(("height_n", "hit"), [(5.1, False), (5.4, True)])
def test_a_later_pulse_stands_out_of_six_times_the_noise_that_is_left_of_21_samples(height_n, hit):
    assert bool(followed_by(flat(height_n, 600), 4.0)) is hit  # 6 * 4 N / sqrt(21) = 5.24 N


def test_a_later_pulse_is_told_with_its_height_and_its_distance():
    top = lambda at, height_n: height_n * np.maximum(1.0 - np.abs(np.arange(4000) - at) / 25.0, 0.0)  # noqa: E731
    assert followed_by(top(1320, 8.0)) == "double hit: another one of 8 N (8 %) 12 ms later"
    assert followed_by(top(175, 8.0)) == "double hit: another one of 8 N (8 %) 0.55 ms later"  # soon after the first


def test_ringing_that_changes_sign_within_half_the_pulse_is_no_hit():
    at = np.arange(4000.0)
    rings = lambda samples: 10.0 * np.exp(-(((at - 700.0) / 150.0) ** 2)) * np.sin(2.0 * np.pi * at / samples)  # noqa: E731
    assert followed_by(rings(21.0)) == ""
    assert followed_by(rings(60.0)).startswith("double hit")


def test_a_later_pulse_is_sought_where_two_means_have_room():
    force = np.interp(np.arange(4000.0), [99, 120, 142], [0.0, 100.0, 0.0]) + flat(50.0, 200, 5)
    assert double_hit(force[:204], WIDE, (), 0.0, 1e5) == ""  # 41 samples after those that are left out
    assert double_hit(force[:205], WIDE, (), 0.0, 1e5).startswith("double hit: another one of 50 N")
