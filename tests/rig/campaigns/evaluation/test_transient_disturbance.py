"""What passes is told from what lasts, in records that are made of formulas."""

import numpy as np
import pytest

from rig.campaigns.evaluation.point import Quality
from rig.campaigns.evaluation.transient_disturbance import has_transient_disturbance, refused_for_a_transient
from rig.tick.layout import recorded_row
from tests.rig.campaigns.made_points import made_point
from tests.rig.rigs import bench_with

BENCH = bench_with()
RATE_HZ, FREQUENCY_HZ = 5000.0, 24.37


def record(extra=lambda time_s: 0.0, periods=50, noise=1e-3):
    """A force with harmonics, a response, noise on both, and what is ``extra`` in the force."""
    time_s = np.arange(int(periods * RATE_HZ / FREQUENCY_HZ)) / RATE_HZ
    theta = 2.0 * np.pi * FREQUENCY_HZ * time_s
    rows = np.zeros(time_s.size, recorded_row(len(BENCH.channels)))
    rows["theta_rad"] = np.mod(theta, 2.0 * np.pi)
    random = np.random.default_rng(4)
    force = np.cos(theta) + 0.4 * np.cos(2.0 * theta + 1.0) + extra(time_s)
    for role, signal in (("force", force), ("drive", 3.0 * np.sin(theta))):
        rows["inputs"][:, BENCH.index_of(role)] = signal + noise * random.standard_normal(time_s.size)
    return rows


def ringing(at_s, size, frequency_hz=134.0, decay_per_s=10.0):
    return lambda t: np.where(
        t > at_s, size * np.exp(-decay_per_s * (t - at_s)) * np.sin(2.0 * np.pi * frequency_hz * (t - at_s)), 0.0
    )


@pytest.mark.parametrize("at_s", [0.3, 1.0, 1.9])
def test_a_knock_that_rings_down_within_the_record_has_come_and_gone(at_s):
    assert has_transient_disturbance(BENCH, record(ringing(at_s, 0.3)))


def test_noise_alone_a_lasting_mode_and_a_loop_that_swings_have_not():
    assert not has_transient_disturbance(BENCH, record())
    assert not has_transient_disturbance(BENCH, record(lambda t: 0.3 * np.sin(2.0 * np.pi * 134.06 * t)))
    assert not has_transient_disturbance(BENCH, record(lambda t: 0.2 * np.sin(2.0 * np.pi * (FREQUENCY_HZ + 1.7) * t)))


def test_a_record_of_a_few_periods_tells_nothing():
    assert not has_transient_disturbance(BENCH, record(ringing(0.05, 0.3), periods=4))
    assert not has_transient_disturbance(BENCH, record()[:0])


def test_lost_samples_alone_are_no_knock():
    rows = record()
    rows["inputs"][3000:3040] = np.nan
    assert not has_transient_disturbance(BENCH, rows)


@pytest.mark.parametrize(
    ("quality", "faults", "steady", "knocked", "again"),
    [
        (Quality.REJECTED, 14, True, False, True),
        (Quality.REJECTED, 14, False, False, True),
        (Quality.REJECTED, 0, True, True, True),
        (Quality.REJECTED, 0, False, True, False),  # of a sweep everything comes and goes
        (Quality.REJECTED, 0, True, False, False),
        (Quality.WARNED, 14, True, True, False),
        (Quality.NOT_SETTLED, 14, True, True, False),
        (Quality.LOST_LOCK, 14, True, True, False),
        (Quality.UNREACHABLE, 14, True, True, False),
        (Quality.OUTSIDE_WINDOW, 14, True, True, False),
        (Quality.IMPLAUSIBLE, 14, True, True, False),
    ],
)
def test_only_refused_points_with_something_that_passes_are_worth_another_attempt(
    quality, faults, steady, knocked, again
):
    rows = record(ringing(1.0, 0.3)) if knocked else record()
    point = made_point(quality=quality)
    assert refused_for_a_transient(point, BENCH, rows, faults, steady) is again
