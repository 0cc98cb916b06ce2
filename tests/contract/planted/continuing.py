"""Faults of devices that go on with the last period of outputs when the next ones come too late."""

import math

import numpy as np

from rig.continuation import STEPS
from rig.drivers.wire import WireOptions
from rig.emulator.outputs import OutputQueue
from tests.contract.planted.table import planted
from tests.rig.wire.memory_link import MemoryDAQ

PERIOD = "late_outputs_are_continued_with_the_last_period"


class ContinuingDAQ(MemoryDAQ):
    """A device of protocol version 2 by the clock, over a wire in memory."""

    queue = OutputQueue

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed, WireOptions(queue_blocks=2), lockstep=False, simulated=1)
        sampling = self.device._sampling
        begin = sampling.start

        def start(rate_hz, block, queue, longest_period, now_s):
            begin(rate_hz, block, queue, longest_period, now_s)
            sampling._outputs = self.queue(block, queue, longest_period)

        sampling.start = start

    @property
    def now_s(self):
        return self.wire.now_s

    @now_s.setter
    def now_s(self, now_s):
        self.wire.pass_time(now_s - self.wire.now_s)

    @property
    def output_v(self):
        self.wire.pass_time(0.001)  # what was sent last arrives
        return np.abs(self.device.output_v).max()

    @property
    def plugged(self):
        return not self.wire.cut

    @plugged.setter
    def plugged(self, plugged):
        self.wire.cut = not plugged


@planted(PERIOD)
class ContinuesItsOwnCopies(ContinuingDAQ):
    """Goes on with its own copies, interpolated by a straight line."""

    class queue(OutputQueue):  # noqa: N801
        def take(self, first, end):
            self.put_out = getattr(self, "put_out", {})
            due = super().take(first, end)
            self.put_out |= {first + index: int(count) for index, count in enumerate(due.counts)}
            return due

        def count_at(self, instant):
            place = instant - int(self._source["period"]) / STEPS
            at = math.floor(place)
            before, after = (self.put_out.get(index, 0) for index in (at, at + 1))
            self.put_out[instant] = round(before + (place - at) * (after - before))
            return self.put_out[instant]


@planted(PERIOD)
class PeriodOffByASample(ContinuingDAQ):
    """Goes on with a period that is off by a sample."""

    class queue(OutputQueue):  # noqa: N801
        def put(self, output, present):
            period = output.period + STEPS * (output.period > 0)
            return super().put(output._replace(period=period), present)


@planted(PERIOD)
class ReadsBackSomethingElse(ContinuingDAQ):
    """Reads back the outputs that it had been sent a period before, and not what it put out."""

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        sampling = self.device._sampling
        counts_of = sampling._counts_of
        sampling._counts_of = lambda volts: counts_of(np.roll(volts, 2))


@planted(PERIOD)
class ReadsBackTheRule(ContinuingDAQ):
    """Puts out 0 V, and reads back what it should have put out."""

    class queue(OutputQueue):  # noqa: N801
        def count_at(self, instant):
            self.told = getattr(self, "told", {})
            self.told[instant] = super().count_at(instant)
            return 0

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        sampling = self.device._sampling
        counts_of = sampling._counts_of

        def told(volts):
            counts, first = counts_of(volts), sampling.measured - volts.size
            for index, count in getattr(sampling._outputs, "told", {}).items():
                if first <= index < first + volts.size:
                    counts[index - first] = count
            return counts

        sampling._counts_of = told


@planted("nothing_is_continued_before_a_period_has_come")
class ContinuesTooSoon(ContinuingDAQ):
    """Goes on before a period has come since ARM."""

    class queue(OutputQueue):  # noqa: N801
        def put(self, output, present):
            in_time = super().put(output, present)
            if in_time is not None and output.period:
                self._source["period"], self._source["end"] = output.period, output.first + self.block
            return in_time


@planted("nothing_is_continued_after_0_v")
class ContinuesAfter0V(ContinuingDAQ):
    """Goes on after the host has said 0 V."""

    class queue(OutputQueue):  # noqa: N801
        said = 0

        def put(self, output, present):
            self.said = output.period or self.said
            return super().put(output._replace(period=self.said), present)


@planted("the_watchdog_ends_what_is_continued")
class ContinuesPastTheWatchdog(ContinuingDAQ):
    """Goes on and on: its watchdog does not bite while there is something to go on with."""

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self.device._life.feed = lambda now_s, in_time: setattr(self.device._life, "_fed_s", math.inf)
