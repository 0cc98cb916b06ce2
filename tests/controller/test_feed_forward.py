"""Feed-forward of the frequency: slopes of known backbones, what it does to the integral; backbones too steep for a ramp."""

import math

import numpy as np
import pytest

from controller.feed_forward import (
    BACKBONE,
    LARGEST_RATIO,
    MOST_POWER,
    add_to_backbone,
    backbone_slope,
    follow_backbone,
    foretold_slope,
    forget_backbone,
    logarithmic_slope,
    steepness,
)
from controller.frequency import FREQUENCY, FREQUENCY_STATE
from controller.lock import FORETOLD_SLOWING, LOCK, MOST_SLOWING, STEEP_PERIODS, LockState, mind_steepness, reacquire


def _shown(backbone, *levels):
    state = np.zeros(1, BACKBONE)[0]
    for level in levels:
        add_to_backbone(state, level, backbone(level))
    return state


def _hardening(level):
    return 150.0 + 3.0 * level + 8.0 * level**2


def test_three_levels_give_the_slope_of_a_parabola_and_older_ones_are_forgotten():
    state = _shown(_hardening, 9.0, 0.4, 0.7, 1.0)
    for level in (1.0, 1.2, 1.4):
        assert backbone_slope(state, level, level) == pytest.approx(3.0 + 16.0 * level, rel=1e-12)


def test_two_levels_give_a_line_and_one_gives_nothing():
    assert backbone_slope(_shown(_hardening, 1.0), 1.5, 1.5) == 0.0
    assert backbone_slope(_shown(_hardening, 0.5, 1.0), 1.5, 1.5) == pytest.approx(3.0 + 8.0 * 1.5, rel=1e-12)


def test_levels_nearer_to_each_other_than_a_quarter_of_the_step_tell_no_slope():
    state = _shown(_hardening, 0.99, 1.0)
    assert backbone_slope(state, 1.02, 1.03) == pytest.approx(3.0 + 8.0 * 1.99, rel=1e-12)
    assert backbone_slope(state, 1.02, 1.05) == 0.0
    add_to_backbone(state, 1.1, _hardening(1.1))  # the two near ones tell no curvature either
    assert backbone_slope(state, 1.2, 1.2) == pytest.approx(3.0 + 8.0 * 2.1, rel=1e-12)


def test_the_slope_keeps_its_sign_and_is_at_most_three_times_that_of_the_last_two_levels():
    assert LARGEST_RATIO == 3.0
    last = (_hardening(1.0) - _hardening(0.9)) / 0.1
    assert backbone_slope(_shown(_hardening, 0.8, 0.9, 1.0), 20.0, 1.1) == pytest.approx(3.0 * last, rel=1e-12)
    assert backbone_slope(_shown(lambda level: -((level - 3.0) ** 2), 1.0, 1.5, 2.0), 9.0, 3.0) == 0.0


def test_a_level_held_again_replaces_its_frequency_and_a_change_of_unit_forgets_all():
    state = _shown(_hardening, 0.5, 1.0)
    add_to_backbone(state, 1.0, 170.0)
    assert state["points"] == 2
    assert backbone_slope(state, 1.2, 1.2) == pytest.approx((170.0 - _hardening(0.5)) / 0.5, rel=1e-12)
    forget_backbone(state)
    assert backbone_slope(state, 1.2, 1.2) == 0.0


def test_a_level_that_was_held_before_the_last_two_gives_a_line():
    assert np.isfinite(backbone_slope(_shown(_hardening, 1.0, 0.5, 1.0), 1.2, 1.2))


def test_over_a_ramp_the_integral_moves_by_the_change_of_the_backbone():
    state, frequency = _shown(_hardening, 0.4, 0.7, 1.0), np.zeros(1, FREQUENCY_STATE)[0]
    follow_backbone(state, frequency, 1.0, 1.0, False)
    for level in np.linspace(1.0, 1.5, 200):
        follow_backbone(state, frequency, level, 1.5, True)
    assert frequency["integral"] == pytest.approx(_hardening(1.5) - _hardening(1.0), rel=1e-9)
    follow_backbone(state, frequency, 7.0, 7.0, False)
    assert frequency["integral"] == pytest.approx(_hardening(1.5) - _hardening(1.0), rel=1e-9)


def test_the_slope_of_a_ramp_is_that_of_the_parabola_through_the_present_level():
    state = _shown(_hardening, 0.7, 1.0)
    for level in (1.1, 1.3, 1.4):
        expected = (3.0 + 16.0 * level) * level / _hardening(level)
        assert logarithmic_slope(state, level, 1.4, _hardening(level)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("levels", "level", "target"),
    [
        ((1.0,), 1.4, 1.4),
        ((0.7, 1.0), 1.05, 1.1),
        ((0.7, 1.0), 1.08, 1.4),
        ((0.7, 1.0), 0.9, 1.4),
        ((1.4, 1.0), 1.2, 1.4),
    ],
    ids=["one level", "near the last level", "at the beginning of a long ramp", "below", "after a way down"],
)
def test_where_noise_would_make_a_slope_there_is_none(levels, level, target):
    assert logarithmic_slope(_shown(_hardening, *levels), level, target, 2.0 * _hardening(level)) == 0.0


def test_from_a_level_next_to_that_of_the_start_a_ramp_has_the_slope_of_a_line():
    state = _shown(
        lambda level: 100.0 + (5.0 if level == 1.0 else 0.0), 0.99, 1.0
    )  # a frequency that had not come to rest
    assert logarithmic_slope(state, 1.4, 1.4, 113.0) == pytest.approx(8.0 / 0.4 * 1.4 / 113.0, rel=1e-12)


@pytest.mark.parametrize("power", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_slope_of_a_power_of_the_level_is_foretold(power, sign):
    """ln(omega) = c L^p / p has the slope c L^p; between levels in equal ratios its mean grows by the same power."""
    state = _shown(lambda level: 100.0 * math.exp(sign * 0.1 * level**power / power), *(1.3**k for k in (-2, -1, 0)))
    expected = sign * 0.1 * 1.3**power
    assert foretold_slope(state, 1.3) == pytest.approx(expected, rel=0.005 * power**2)


def test_a_slope_that_does_not_grow_or_turns_foretells_nothing_and_noise_no_more_than_the_sixth_power():
    assert foretold_slope(_shown(lambda level: 9.0 + math.log(level), 0.5, 0.7, 1.0), 1.4) == 0.0
    assert foretold_slope(_shown(lambda level: 100.0 + level, 0.5, 0.7), 1.4) == 0.0
    assert foretold_slope(_shown(lambda level: 100.0 - (level - 0.7) ** 2, 0.5, 0.7, 1.0), 1.4) == 0.0
    assert foretold_slope(_shown(_hardening, 0.5, 0.7, 1.0), 0.9) == 0.0
    jump = _shown({0.8: 100.0, 0.9: 100.001, 1.0: 101.0}.get, 0.8, 0.9, 1.0)
    last = math.log(101.0 / 100.001) / math.log(1.0 / 0.9)
    assert foretold_slope(jump, 1.1) == pytest.approx(last * (1.1 / math.sqrt(0.9)) ** MOST_POWER, rel=1e-12)


def test_softening_and_hardening_have_their_own_bounds_and_without_bounds_nothing_is_steep():
    law = np.zeros(1, FREQUENCY)[0]
    law["most_softening"], law["most_hardening"] = 0.05, 0.2
    assert steepness(law, 0.1) == pytest.approx(0.5)
    assert steepness(law, -0.1) == pytest.approx(2.0)
    law["most_softening"] = law["most_hardening"] = 0.0
    assert steepness(law, 0.1) == steepness(law, -0.1) == 0.0


def test_a_ramp_slows_from_half_of_the_steepest_slope_on_and_three_steep_periods_end_it():
    lock = np.zeros(1, LOCK)[0]
    lock["state"] = LockState.LOCKED

    def slowing(here, ahead):
        mind_steepness(lock, here, ahead)
        return float(lock["steep_slowing"])

    assert slowing(0.4, 0.5) == 0.0
    assert slowing(0.75, 0.0) == slowing(0.0, 0.75) == pytest.approx(0.5)
    assert slowing(5.0, 0.0) == MOST_SLOWING < 1.0
    assert slowing(0.0, 5.0) == FORETOLD_SLOWING < MOST_SLOWING
    assert slowing(0.0, 0.0) == 0.0
    assert lock["state"] == LockState.LOCKED
    lock["steep_periods"] = 0
    for here in (1.1,) * (STEEP_PERIODS - 1) + (0.9,) + (1.1,) * (STEEP_PERIODS - 1):
        slowing(here, 0.0)
        assert lock["state"] == LockState.LOCKED
    slowing(1.1, 0.0)
    assert lock["state"] == LockState.LOST
    reacquire(lock)
    assert lock["steep_periods"] == 0
