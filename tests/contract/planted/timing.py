"""Faults of time: clocks, stalls, and what happens once the device is gone. Time is simulated."""

from rig.errors import DaqDisconnected
from tests.contract.planted.drivers import PacedDAQ, TimedDAQ
from tests.contract.planted.table import planted

CLOCK = "the_clock_runs_at_the_sample_rate"
STALL = "no_block_comes_late"
GONE = "a_device_that_is_gone_is_a_daq_error_and_can_be_closed"
PROMPT = "stop_and_close_are_prompt"


@planted(CLOCK)
class IsFast(PacedDAQ):
    """A clock 1 % fast."""

    rate_share = 1.01


@planted(CLOCK)
class IsSlow(PacedDAQ):
    """A clock 1 % slow."""

    rate_share = 0.99


@planted(CLOCK)
class HasAnotherRate(PacedDAQ):
    """Samples at 4096 Hz where 5000 Hz are declared."""

    rate_share = 0.8192


@planted(CLOCK)
class HasNoClock(TimedDAQ):
    """Says that it has a clock, and returns at once."""

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"paced": True, "repeatable": False})


class Stalls(TimedDAQ):
    stall_s, every, calls = 0.05, 100, 0

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.calls += 1
        self.now_s += self.stall_s * (self.calls % self.every == 0)


@planted("a_block_takes_no_longer_than_it_lasts")
class SleepsForASecond(Stalls):
    """Sleeps for a second in every block."""

    stall_s, every = 1.0, 1


@planted(STALL)
class StallsFor50Ms(Stalls):
    """Stalls of 50 ms, one in 500 blocks."""

    every = 500


@planted(STALL)
class StallsFor50MsByTheClock(PacedDAQ):
    """Stalls of 50 ms, one in 500 blocks, of a device with a clock."""

    calls = 0

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.calls += 1
        self.now_s += 0.05 * (self.calls % 500 == 0)


@planted(STALL)
class SleepsEvery20Blocks(Stalls):
    """One second of sleep every 20 blocks."""

    stall_s, every = 1.0, 20


@planted(GONE)
class HangsWhenGone(TimedDAQ):
    """A hang of 2 s when unplugged."""

    def _exchange(self, voltages, inputs):
        self.now_s += 0.0 if self.plugged else 2.0
        super()._exchange(voltages, inputs)


@planted(GONE)
class HangsInCloseWhenGone(TimedDAQ):
    """Close hangs for 2 s when unplugged."""

    def _close(self):
        self.now_s += 0.0 if self.plugged else 2.0
        super()._close()


@planted(GONE)
class GoesOnWhenGone(TimedDAQ):
    """Goes on with zeros when unplugged."""

    def _exchange(self, voltages, inputs):
        if not self.plugged:
            inputs[:] = 0.0
            return
        super()._exchange(voltages, inputs)


@planted(GONE)
class SaysNothingWhenGone(TimedDAQ):
    """An error without a message when unplugged."""

    def _exchange(self, voltages, inputs):
        if not self.plugged:
            raise DaqDisconnected
        super()._exchange(voltages, inputs)


@planted(GONE)
class CannotCloseWhenGone(TimedDAQ):
    """Close fails when unplugged."""

    def _close(self):
        if not self.plugged:
            raise DaqDisconnected("no such device")
        super()._close()


@planted(PROMPT)
class StopsSlowly(TimedDAQ):
    """A stop that takes 3 s."""

    def _stop(self):
        self.now_s += 3.0
        super()._stop()


@planted(PROMPT)
class ClosesSlowly(TimedDAQ):
    """A close that takes 3 s."""

    def _close(self):
        self.now_s += 3.0
        super()._close()
