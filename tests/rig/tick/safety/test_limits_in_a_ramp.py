"""A trip's ramp that does not help: what goes on rising is cut off."""

import numpy as np
import pytest

from rig.drivers.virtual import VirtualDAQ
from rig.loop.loop import Loop
from rig.tick.safety.layout import EndReason, GuardMode
from tests.rig.loop.worker.rigs import slow_bench, tone

TRIP = 300


class PushedDAQ(VirtualDAQ):
    """Reads, at some samples, that multiple of the limit on one channel. ``pushes``: samples and multiples."""

    run_fused = None
    channel = 0
    limit = 0.0
    pushes: tuple[tuple[int, float], ...] = ()

    def _exchange(self, voltages, inputs):
        first = self._first
        super()._exchange(voltages, inputs)
        for sample, multiple in self.pushes:
            if first <= sample < first + voltages.size:
                volts = self.limit * self.channels[self.channel].sensitivity_v_per_unit
                inputs[sample - first, self.channel] = multiple * volts


def run(role, *pushes, hold_s=1.0):
    bench = slow_bench("virtual")
    limits = bench.limits.model_copy(update={"force_n": 5.0, "acceleration_m_s2": 20.0})
    bench = bench.model_copy(update={"limits": limits})
    with PushedDAQ(bench, 1) as daq:
        daq.channel, daq.pushes = bench.index_of(role), pushes
        daq.limit = limits.force_n if role == "force" else limits.acceleration_m_s2
        daq.start(bench.block)
        loop = Loop(daq, tone(bench, hold_s).build(daq.latency_samples), fused=False)
        rows = np.concatenate(list(loop.run()))
    return loop.tick.guard[0], rows


@pytest.mark.parametrize(("role", "reason"), [("force", EndReason.FORCE_LIMIT), ("drive", EndReason.RESPONSE_LIMIT)])
def test_force_or_acceleration_far_beyond_its_limit_while_a_trip_ramps_down_is_0_v_at_once(role, reason):
    guard, rows = run(role, (TRIP, 1.1), (TRIP + 50, 1.2), (TRIP + 60, -1.3))
    assert (guard["reason"], guard["sample"], guard["dropped"]) == (reason, TRIP, 1)
    assert abs(guard["value"]) == pytest.approx(1.1 * (5.0 if role == "force" else 20.0), rel=1e-6)
    assert rows["guard"][TRIP - 1] == GuardMode.ARMED
    assert (rows["guard"][TRIP : TRIP + 60] == GuardMode.RAMPING).all()
    assert rows["guard"][TRIP + 60] == GuardMode.OFF


def test_a_little_beyond_the_limit_the_ramp_goes_on():
    guard, rows = run("force", (TRIP, 1.1), (TRIP + 60, 1.2))
    assert guard["dropped"] == 0
    assert np.count_nonzero(rows["guard"] == GuardMode.RAMPING) == 300  # 0.3 s


def test_a_ramp_that_is_no_trip_is_not_cut_off():
    whole = run("force", hold_s=0.2)[1]
    first = int(np.flatnonzero(whole["guard"] == GuardMode.RAMPING)[0])
    guard, _ = run("force", (first + 20, 1.3), hold_s=0.2)
    assert (guard["reason"], guard["dropped"]) == (EndReason.COMPLETED, 0)
