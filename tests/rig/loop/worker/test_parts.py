"""Histogram and pace of the wall-clock loop, against numpy and clocks made up."""

import time

import numpy as np
import pytest

from rig.loop.worker.histogram import Histogram
from rig.loop.worker.pace import DevicePace, HostPace
from rig.loop.worker.spawn import ask


def test_quantiles_of_a_histogram_are_those_of_its_times_within_a_bin():
    times_us = np.random.default_rng(1).lognormal(3.0, 1.5, 20_000)
    histogram = Histogram()
    for time_us in times_us:
        histogram.add(int(1000 * time_us))
    assert histogram.count == times_us.size
    for share in (0.5, 0.99, 0.999):
        assert histogram.quantile_us(share) == pytest.approx(np.quantile(times_us, share), rel=0.06)
    assert histogram.largest_us == pytest.approx(times_us.max(), rel=1e-3)
    bins = histogram.bins()
    assert sum(bins["count"]) == times_us.size
    assert bins["upper_edge_us"] == sorted(bins["upper_edge_us"])


def test_times_beyond_every_bin_are_counted_too():
    histogram = Histogram()
    for nanoseconds in (0, 999, 10**12):
        histogram.add(nanoseconds)
    assert histogram.count == 3
    assert histogram.report() == {"p50": 1.0, "p99": 1e9, "p99_9": 1e9, "largest": 1e9}


def test_a_loop_paced_by_the_host_keeps_its_absolute_deadlines_and_leaves_out_what_it_missed():
    pace = HostPace(0.002)
    pace.begin()
    due, skipped_at_first = [], 0
    for number in range(50):
        pace.wait()
        skipped_at_first = pace.skipped if number == 0 else skipped_at_first
        now = time.monotonic_ns()
        due.append(pace.release(now))
        assert due[-1] <= now
        if number == 10:
            time.sleep(0.0075)  # three deadlines pass
    periods = (np.array(due) - due[0]) / 2e6
    assert np.allclose(periods, np.round(periods), atol=1e-5)  # none is ever moved
    assert periods[-1] == pytest.approx(49 + pace.skipped - skipped_at_first)
    assert periods[11] - periods[10] >= 3.0


@pytest.mark.parametrize("clock", [1.0 - 1e-4, 1.0, 1.0 + 1e-4])
def test_the_release_of_a_device_paced_block_follows_the_device_s_clock(clock):
    period_ns, late = 1_000_000, np.random.default_rng(2).exponential(50_000.0, 20_000)
    late[::50] = 0.0
    pace = DevicePace(1e-3)
    pace.begin()
    found = []
    for number in range(late.size):
        arrival = int(5e9 + number * period_ns * clock + late[number])
        found.append(arrival - pace.release(arrival))
    error = np.array(found) - late
    assert np.abs(error[1000:]).max() < 16_000  # between two blocks that are on time it drifts by up to 50 x 0.3 us


def test_what_is_asked_of_the_system_is_said_and_nothing_is_asked_where_nothing_is_to_be():
    said = ask("probe", 1000.0, 0.1, False)
    assert said["scheduling"] == said["memory"] == "not asked for"
    assert said["garbage_collector"] == "off"
    assert 0.0 <= said["wake_up_us"]["p50"] <= said["wake_up_us"]["largest"]
    assert ask("probe", 1000.0, 0.1, True)["scheduling"] in ("SCHED_FIFO 80", "not permitted", "not on this system")
