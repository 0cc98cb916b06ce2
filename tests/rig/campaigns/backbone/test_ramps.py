"""Phase errors in the ramps of a recorded backbone, against those of rows that were made for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from controller import preset
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.ramps import ramps_in

RATE_HZ, PER_PERIOD = 5000.0, 200


def part_of(**rows):
    return SimpleNamespace(rows=lambda name: np.asarray(rows[name]))


def plan(**changes):
    table = {"bench": "magnet-beam", "controller": preset("magnet-beam").model_dump(), "levels_v": [0.2, 0.4, 0.6]}
    return BackbonePlan.model_validate(table | changes)


def test_each_ramp_has_its_length_and_the_largest_mean_error_of_a_period():
    segments = np.array(
        [0, 1, 2, 2, 3, 3, 3, 4, 5, 5, 6, 6, 7, 8]
    )  # of each period: ramp, settle and record, three times
    mean_deg = np.array([40.0, 5.0, 1.0, -3.0, 1.0, -12.0, 3.0, 0.0, -1.0, 5.0, 8.0, 7.0, 2.0, 0.0])
    theta = np.tile(np.linspace(0.0, 2.0 * np.pi, PER_PERIOD, endpoint=False), segments.size)
    ripple = 90.0 * np.cos(theta)  # within a period, of no effect on its mean
    error = np.repeat(mean_deg, PER_PERIOD) + ripple
    part = part_of(
        segment=np.repeat(segments, PER_PERIOD), theta_rad=theta, phase_error_rad=np.radians(error).astype("f4")
    )
    first, second = ramps_in(part, plan(ramp_periods=2, ramp_factors=[1, 1, 1.5]), RATE_HZ)
    assert first == pytest.approx((0.2, 0.4, 1.0, 1.5, 12.0, 3.0), rel=1e-5)
    assert second == pytest.approx((0.4, 0.6, 1.5, 1.0, 8.0, 3.0), rel=1e-5)


def test_a_run_that_was_stopped_has_the_ramps_that_it_began():
    theta = [0.0, 6.0, 0.1, 6.0, 0.1, 6.0]
    part = part_of(segment=[0, 0, 2, 2, 3, 3], theta_rad=theta, phase_error_rad=[0.0, 0.0, 0.0, 0.0, 0.1, np.nan])
    (ramp,) = ramps_in(part, plan(), RATE_HZ)
    assert ramp == pytest.approx((0.2, 0.4, 1.0, 0.05, np.degrees(0.05), 0.0))
    empty = np.zeros(0)
    assert ramps_in(part_of(segment=empty, theta_rad=empty, phase_error_rad=empty), plan(), RATE_HZ) == ()
