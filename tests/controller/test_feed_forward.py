"""Feed-forward of the frequency: slopes of known backbones, and what it does to the integral."""

import numpy as np
import pytest

from controller.feed_forward import (
    BACKBONE,
    LARGEST_RATIO,
    add_to_backbone,
    backbone_slope,
    follow_backbone,
    forget_backbone,
)
from controller.frequency import FREQUENCY_STATE


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
