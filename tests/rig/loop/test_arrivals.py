"""Lateness and rate of blocks, from arrivals whose stalls are known."""

import numpy as np
import pytest

from rig.loop.arrivals import lateness_s, reached_blocks_s


def arrivals(stalls, n=400, period_s=0.002, device_stops=()):
    """Instants at which blocks arrive, with the host away in ``stalls`` and the device's clock at rest in ``device_stops``."""
    due = period_s * np.arange(1, n + 1)
    for begin, length in device_stops:
        due = due + np.where(due > begin, length, 0.0)
    at = due.copy()
    for begin, length in stalls:
        at = np.where((due > begin) & (due < begin + length), begin + length, at)
    return at


def test_blocks_on_time_are_not_late():
    np.testing.assert_allclose(lateness_s(arrivals([]), 0.002), 0.0, atol=1e-12)


def test_a_stall_of_the_host_makes_every_block_within_it_late_by_what_is_left_of_it():
    late = lateness_s(arrivals([(0.1, 0.031)]), 0.002)
    np.testing.assert_allclose(late[50:65], 0.029 - 0.002 * np.arange(15), atol=1e-12)
    assert np.count_nonzero(late > 1e-9) == 15


def test_a_device_whose_clock_stands_still_makes_no_block_late():
    np.testing.assert_allclose(lateness_s(arrivals([], device_stops=[(0.1, 0.04)]), 0.002), 0.0, atol=1e-12)


def test_a_clock_that_is_slow_or_fast_by_50_ppm_is_hardly_late():
    for drift in (5e-5, -5e-5):
        late = lateness_s(arrivals([], n=2000) * (1.0 + drift), 0.002)
        assert late.max() <= 5e-5 * 1.001  # of the second that is looked ahead at most


def test_the_rate_that_is_reached_does_not_depend_on_a_stall_at_the_end():
    assert reached_blocks_s(arrivals([(0.77, 0.04)]), 0.002) == pytest.approx(500.0)
    slow = reached_blocks_s(arrivals([], device_stops=[(0.1 * n, 0.02) for n in range(1, 8)]), 0.002)
    assert slow == pytest.approx(500.0 / 1.2, rel=0.05)
    assert reached_blocks_s(np.zeros(1), 0.002) == 0.0
