"""Choice of the quickest gains among those that bear enough of the wanted hardening and softening."""

from types import SimpleNamespace

import pytest

from rig.tuning.design import MAX_SLOPE_LOSS, WANTED_HARDENING, WANTED_SOFTENING, _Candidate, _quickest


def _candidate(hardening, quickness, softening=WANTED_SOFTENING):
    loop = SimpleNamespace(low_pass_rad_s=quickness)
    found = _Candidate(
        loop, share=1.0, proportional=0.0, response_share=2.0, cancels=1.0, slopes=(softening, hardening)
    )
    assert found.quickness == quickness
    return found


def test_quicker_gains_give_away_a_part_of_the_most_that_any_bears_and_not_step_by_step_more():
    chain = [_candidate(0.1 * (1.0 - 0.6 * MAX_SLOPE_LOSS * step), 1.0 + step) for step in range(5)]
    _, best, design = _quickest(chain[::-1], lambda loop: loop)
    assert best is chain[1]
    assert design is best.loop


def test_little_is_given_away_of_a_little_that_is_borne():
    """Twice the quickness is not worth half of the hardening, however small this part of the wanted range is."""
    chain = [_candidate(0.04, 1.0), _candidate(0.02, 2.0)]
    assert _quickest(chain, lambda loop: loop)[1] is chain[0]


@pytest.mark.parametrize(("softening", "chosen"), [(0.98, 1), (0.5, 0)])
def test_softening_and_hardening_count_each_for_itself(softening, chosen):
    chain = [_candidate(0.1, 1.0), _candidate(0.1, 2.0, softening * WANTED_SOFTENING)]
    assert _quickest(chain, lambda loop: loop)[1] is chain[chosen]


def test_what_is_borne_beyond_the_wanted_slopes_counts_for_nothing():
    chain = [_candidate(9.0 * WANTED_HARDENING, 1.0), _candidate(WANTED_HARDENING, 2.0)]
    assert _quickest(chain, lambda loop: loop)[1] is chain[1]


def test_gains_that_do_not_suit_count_neither_as_best_nor_as_the_most_that_any_bears():
    chain = [_candidate(0.2, 9.0), _candidate(0.1, 1.0), _candidate(0.098, 2.0), _candidate(0.05, 3.0)]
    assert _quickest(chain, lambda loop: loop if loop.low_pass_rad_s < 9.0 else None)[1] is chain[2]
    assert _quickest(chain, lambda _: None) == (4, None, None)
