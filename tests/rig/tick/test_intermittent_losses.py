"""Losses with good samples in between, and means while samples are lost."""

import numpy as np
import pytest

from rig.daq import LOST
from rig.loop.loop import Loop
from rig.tick.kernels import tick_block
from rig.tick.safety.layout import EndReason
from tests.rig.loop.worker.rigs import slow_bench, tone
from tests.rig.lossy import LossyDAQ
from tests.rig.tick.blocks import nothing_told

RATE_HZ = 1000


def ended(lost, hold_s):
    bench = slow_bench("virtual")
    with LossyDAQ(bench, 1) as daq:
        daq.lost = lost
        daq.start(bench.block)
        loop = Loop(daq, tone(bench, hold_s).build(daq.latency_samples))
        for _ in loop.run():
            pass
    return loop.tick


def test_a_single_sample_between_two_gaps_does_not_make_them_short():
    lost = np.zeros(2000, bool)
    lost[400:491] = True
    lost[445] = False
    guard = ended(lost, 1.0).guard[0]
    assert guard["reason"] == EndReason.SAMPLES_LOST
    assert guard["sample"] == 451  # 45 lost, one back, 6 more: 50 ms
    assert guard["value"] == pytest.approx(0.05)


def test_a_gap_within_the_limit_is_forgotten_once_as_many_samples_have_come():
    lost = np.zeros(2000, bool)
    lost[400:445] = lost[490:535] = True
    tick = ended(lost, 1.0)
    assert tick.guard["reason"][0] == EndReason.COMPLETED
    assert tick.arrays.loop["lost"][0] == 0


def test_single_losses_of_one_in_a_hundred_never_trip():
    tick = ended(np.arange(20_000) % 100 == 7, 10.0)
    assert tick.guard["reason"][0] == EndReason.COMPLETED
    assert tick.arrays.loop["lost"][0] <= 1


def test_the_mean_is_at_first_that_of_the_samples_seen():
    bench = slow_bench("virtual")
    tick = tone(bench, 1.0).build(1.5)
    lost, seen = 100, 3
    n = lost + seen
    volts = np.full((n, len(bench.channels)), np.nan)
    volts[lost:] = np.array([0.01, 0.04, 0.07])[:, None]
    flags = np.where(np.arange(n) < lost, LOST, 0).astype(np.uint16)
    tick_block(tick.arrays, volts, flags, *tick.buffers(n), np.empty(n), *nothing_told(n))
    scale = np.array([1.0 / channel.sensitivity_v_per_unit for channel in bench.channels])
    assert tick.arrays.loop["seen"][0] == seen
    np.testing.assert_allclose(tick.arrays.watches["mean"], 0.04 * scale, rtol=1e-12)
