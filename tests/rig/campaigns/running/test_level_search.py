"""Search for a multisine's level: upwards from a low one, and downwards where the first is too much for the bench."""

import math

import pytest

from rig.bench import load_bench
from rig.campaigns.running.level_search import FIRST, TOO_HIGH, LevelSearch, Seen

SEARCH = LevelSearch(safe_share=0.5, least_rise=1.05, most_levels=12)
BENCH = load_bench("magnet-beam")
FIRST_V = FIRST * BENCH.limits.voltage_v


def _listening(enough_from_v, limit_v):
    """Responses that stand out from a level on, with peaks in proportion to the level."""
    return lambda level: Seen(level >= enough_from_v, level / limit_v, 3.0)


def test_a_level_rises_until_it_suffices():
    tried, enough = SEARCH.search(BENCH, _listening(8.0 * FIRST_V, 1e3 * FIRST_V))
    assert enough
    assert tried == pytest.approx([FIRST_V, 3.0 * FIRST_V, 9.0 * FIRST_V])


def test_a_first_level_near_the_limits_is_lowered_even_though_it_suffices():
    tried, enough = SEARCH.search(BENCH, _listening(0.1 * FIRST_V, FIRST_V / 0.89))
    assert enough
    assert tried == pytest.approx([FIRST_V, 0.5 / 0.89 * FIRST_V])


def test_a_level_between_the_safe_share_and_too_high_stays_and_so_does_one_without_readings():
    assert SEARCH.next_level(1.0, Seen(True, TOO_HIGH, 3.0)) is None
    assert SEARCH.next_level(1.0, Seen(False, TOO_HIGH, 3.0)) is None
    assert SEARCH.next_level(1.0, Seen(False, math.inf, 3.0)) is None
