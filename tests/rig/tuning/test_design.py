"""Choice of the quickest gains among those that bear enough of the wanted hardening and softening."""

from types import SimpleNamespace

import pytest

from rig.tuning.design import MAX_SLOPE_LOSS, _quickest


def _candidate(worth, quickness):
    return SimpleNamespace(worth=worth, quickness=quickness, loop=(worth, quickness))


def test_quicker_gains_give_away_a_part_of_the_most_that_any_bears_and_not_step_by_step_more():
    chain = [_candidate(1.8 - 0.6 * MAX_SLOPE_LOSS * step, 1.0 + step) for step in range(5)]
    tried, best, design = _quickest(chain[::-1], lambda loop: loop)
    assert (tried, design) == (2, best.loop)
    assert best is chain[1]


def test_gains_that_do_not_suit_count_neither_as_best_nor_as_the_most_that_any_bears():
    chain = [_candidate(2.0, 9.0), _candidate(1.7, 1.0), _candidate(1.65, 2.0), _candidate(1.4, 3.0)]
    assert _quickest(chain, lambda loop: loop if loop[0] < 2.0 else None)[1].quickness == pytest.approx(2.0)
    assert _quickest(chain, lambda _: None) == (4, None, None)
