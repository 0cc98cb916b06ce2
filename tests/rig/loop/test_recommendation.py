"""The rule by which ``rig doctor --daq`` recommends block, queue, watchdog and rate, in cases that can be computed by hand."""

import math

import pytest
from hypothesis import given, strategies as st

from rig.daq import Adjustable
from rig.loop.recommendation import BUSY, GAPS, RESERVE, Settings, Timing, complaints, recommend

RATE_HZ = 5000.0
QUICK = Timing(late_s=0.0, gap_s=0.001, round_trip_s=0.0, busy_s=1e-5)
NOW = Settings(block=10, queue_blocks=1, watchdog_s=0.1)
BLOCKS = (1, 2, 5, 10, 20, 50, 100)


def allowed(**changes):
    facts = {
        "watchdog_s": 0.1,
        "largest_queue": 64,
        "watchdog_range_s": (0.001, 1.0),
        "rate_range_hz": (1.0, RATE_HZ),
        "wire_share": dict.fromkeys(BLOCKS, 0.0),
        "largest_wire_share": 0.9,
    }
    return Adjustable(**facts | changes)


def advised(timing, now=NOW, allow=None, largest_block=1000):
    return recommend(timing, now, RATE_HZ, allow or allowed(), largest_block)


def test_a_bench_that_is_quick_enough_is_left_as_it_is():
    advice = advised(QUICK)
    assert advice.settings == NOW
    assert advice.holds


@pytest.mark.parametrize(
    ("late_s", "blocks"), [(0.0, 1), (0.00066, 1), (0.00067, 2), (0.002, 2), (0.0021, 3), (0.030, 23)]
)
def test_the_queue_lasts_for_the_lateness_with_its_reserve_and_half_a_block(late_s, blocks):
    """Blocks of 2 ms: q = ceil(1.5 late / 2 ms + 0.5)."""
    assert blocks == math.ceil(RESERVE * late_s / 0.002 + 1.0 - BUSY)
    assert advised(QUICK._replace(late_s=late_s)).settings.queue_blocks == blocks


def test_round_trip_and_time_on_the_wire_count_once():
    late = QUICK._replace(late_s=0.002, round_trip_s=0.0015)  # 3 + 1.5 ms; half a block of 2 ms
    assert advised(late).settings.queue_blocks == 3
    full = allowed(wire_share={10: 0.5})  # 1 ms more, of 2 ms
    assert advised(late, allow=full).settings.queue_blocks == 4


@given(st.floats(0.0, 0.2), st.floats(0.0, 0.01), st.floats(0.0, 0.001), st.sampled_from(BLOCKS), st.integers(1, 64))
def test_what_is_recommended_fulfils_the_rule_wherever_it_says_that_it_holds(late, trip, busy, block, queue):
    timing = Timing(late, late + 0.001, trip, busy)
    advice = advised(timing, Settings(block, queue, 0.1))
    block_s = advice.settings.block / RATE_HZ
    lasts_s = advice.settings.queue_blocks * block_s
    needed_s = RESERVE * late + trip + (1.0 - BUSY) * block_s
    assert advice.holds is (lasts_s >= needed_s * (1.0 - 1e-9))
    assert 1 <= advice.settings.queue_blocks <= 64
    assert advice.settings.watchdog_s <= 1.0
    assert advice.settings.block >= block


def test_a_longer_queue_of_the_bench_is_kept_up_to_twice_the_needed_length():
    late = QUICK._replace(late_s=0.002)  # 2 blocks
    kept = [advised(late, NOW._replace(queue_blocks=queue)).settings.queue_blocks for queue in (1, 2, 3, 4, 5)]
    assert kept == [2, 2, 3, 4, 2]


def test_where_the_longest_queue_is_too_short_the_block_grows():
    """45 ms at blocks of 0.2 ms are 226 blocks; of 1 ms they are 46."""
    advice = advised(QUICK._replace(late_s=0.030), Settings(1, 1, 0.1))
    assert advice.settings[:2] == (5, 46)
    assert "64 shorter blocks" in advice.reasons["block"]


def test_where_nothing_is_long_enough_it_says_so():
    advice = advised(
        QUICK._replace(late_s=0.030), allow=allowed(largest_queue=2, wire_share={10: 0.0}), largest_block=10
    )
    assert not advice.holds
    assert advice.settings.queue_blocks == 2
    assert "more than 2 cannot be set" in advice.reasons["queue_blocks"]


def test_the_block_grows_until_the_driver_needs_half_of_it():
    assert advised(QUICK._replace(busy_s=0.0001), Settings(1, 1, 0.1)).settings.block == 1
    assert advised(QUICK._replace(busy_s=0.00011), Settings(1, 1, 0.1)).settings.block == 2
    assert advised(QUICK._replace(busy_s=0.0021), Settings(1, 1, 0.1)).settings.block == 50


def test_the_block_grows_until_the_wire_carries_it():
    shares = {1: 1.1, 2: 0.9, 5: 0.89, 10: 0.5}
    assert advised(QUICK, Settings(1, 1, 0.1), allowed(wire_share=shares)).settings.block == 5


@pytest.mark.parametrize(("gap_s", "watchdog_s"), [(0.030, 0.1), (0.0334, 0.11), (0.2, 0.6), (0.5, 1.0)])
def test_the_watchdog_is_three_times_the_longest_gap_and_no_longer_than_allowed(gap_s, watchdog_s):
    assert min(1.0, max(0.1, GAPS * gap_s)) == pytest.approx(watchdog_s, rel=0.1)
    advice = advised(QUICK._replace(gap_s=gap_s))
    assert advice.settings.watchdog_s == pytest.approx(watchdog_s)
    assert ("more than 1 s are not allowed" in advice.reasons["watchdog_s"]) is (gap_s == 0.5)


def test_the_largest_rate_is_that_of_what_bounds_it_most():
    rates = allowed(rate_range_hz=(1.0, 20_000.0))
    assert advised(QUICK, allow=rates).largest_rate_hz == 20_000.0
    busy = advised(QUICK._replace(busy_s=0.0005), allow=rates)  # half of 10 samples in 0.5 ms
    assert busy.largest_rate_hz == 10_000.0
    assert "computes" in busy.reasons["largest_rate_hz"]
    full = advised(QUICK, allow=rates._replace(wire_share={10: 0.6}))  # 0.9 / 0.6 of 5 kHz
    assert full.largest_rate_hz == 7500.0
    assert "wire" in full.reasons["largest_rate_hz"]
    late = advised(QUICK._replace(late_s=0.05), allow=rates)  # 63.5 blocks of 10 samples in 75 ms
    assert late.largest_rate_hz == 8400.0
    assert "queue" in late.reasons["largest_rate_hz"]


def test_a_driver_without_such_options_is_given_a_longer_block_only():
    late = QUICK._replace(late_s=0.006)  # 9 ms with the reserve, in one block less half of it
    advice = recommend(late, Settings(10, 1, None), RATE_HZ, None, 1000)
    assert advice.settings == Settings(100, 1, None)
    assert "watchdog_s" not in advice.reasons


def test_complaints_name_what_is_wrong_and_are_silent_where_nothing_is():
    assert complaints(QUICK, NOW, RATE_HZ, allowed(), RATE_HZ) == []
    late, watchdog, rate = complaints(Timing(0.005, 0.2, 0.001, 0.0), NOW, RATE_HZ, allowed(), 4000.0)
    assert "up to 6 ms" in late
    assert "queue of 1 blocks lasts 2 ms" in late
    assert "watchdog's 0.1 s" in watchdog
    assert "0.2 s" in watchdog
    assert "4000 of 5000 samples" in rate
