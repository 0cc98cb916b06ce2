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
