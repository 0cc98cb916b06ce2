"""How long calls take, and the rate of the clock; with room for a busy machine, and a word where it was too busy to judge."""

import gc
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from rig.conformance.subject import TOO_BUSY, DriverUnderTest, has_clock
from rig.daq import DAQ, State
from rig.errors import DaqError

SLOW_TEST = "test_a_block_takes_no_longer_than_it_lasts"
BLOCK_S = 0.05  # s; duration of the blocks that are timed; chosen: long beside the clock, short beside a test
BLOCKS = 5  # number of them; chosen
STORED_BLOCKS = 1000  # that a driver may have in store of a device that is gone; chosen
PACED_FACTOR = 2.0  # of a block's own time: the median block of a device with a clock
WAITING_FACTOR = 10.0  # of one that returns at once, or waits for the host
SHORTEST_S = 0.1  # that a busy machine may need for any block
TRIES = 3  # what happens in all of them is the driver's
FIRST_BLOCKS = 20  # in which compilers run and buffers fill
ENOUGH_STALLS = 3  # stalls after which a run is judged; chosen
ALONE = 5.0  # times the tries' duration for which the host is watched without the device; chosen
ALONE_S = (5.0, 30.0)  # least and most of that, s; chosen
BINS = 20  # parts of a run for the slope of the clock; chosen: an odd stall spoils one or two
MEDIAN_TO_ERROR = 1.4826 * 1.2533  # median deviation to the standard error of a median, times the root of the count
SURE = 3.0  # standard errors


class Drift(NamedTuple):
    """How far a device's clock is off, as a share of the rate, and its standard error."""

    share: float
    error: float


class TimingTests(DriverUnderTest):
    """Tests of the clock, and of the time in which a device that is gone is noticed."""

    late_s = 0.025
    """Time by which no block may come later than usual, s."""
    late_blocks = 2000
    """Blocks over which that is looked for."""
    clock_share = 0.002
    """Difference from the sample rate that a device's clock may have, as a share."""
    clock_s = 3.0
    """Time over which the clock is compared, s."""

    def test_a_block_takes_no_longer_than_it_lasts(self) -> None:
        """The median of some blocks: up to twice its own time where the device has a clock, ten times where it has none."""
        with self.punctual(), self.make() as daq:
            block = min(daq.capabilities.largest_block, max(1, math.ceil(BLOCK_S * daq.sample_rate_hz)))
            daq.start(block)
            daq.exchange(np.zeros(block))  # what is compiled or filled at first takes no part
            taken_s = [self.seconds(daq, lambda: daq.exchange(np.zeros(block))) for _ in range(BLOCKS)]
            factor = PACED_FACTOR if has_clock(daq) else WAITING_FACTOR
            allowed_s = max(SHORTEST_S, factor * daq.block / daq.sample_rate_hz)
        median_s = float(np.median(taken_s))
        block_s = block / daq.sample_rate_hz
        assert median_s <= allowed_s, (
            f"a block of {block} samples lasts {block_s:.3g} s and takes {median_s:.3g} s: allowed is {allowed_s:.3g} s"
        )

    def test_no_block_comes_late(self) -> None:
        """Of thousands none takes 25 ms longer than usual, unless the host was late itself; tried up to three times.

        A host that stalls without the device too, in some seconds after these tries, does not judge.
        """
        seen = []
        began_s = time.perf_counter()
        for _ in range(TRIES):
            stalls_s, host_was_late = self._stalls_s()
            if not stalls_s and not host_was_late:
                return
            seen.append(max(stalls_s, default=0.0))
        alone_s = float(np.clip(ALONE * (time.perf_counter() - began_s), *ALONE_S))
        if min(seen) == 0.0 or self.host().stalls_alone(self.late_s, alone_s):
            self.unproven(TOO_BUSY)
        raise AssertionError(
            f"a block took up to {max(seen):.3g} s, for which the host was not late enough: allowed is {self.late_s:g} s "
            "longer than usual"
        )

    def _stalls_s(self) -> tuple[list[float], bool]:
        """Blocks that took too long while the host was punctual, s; whether there were others."""
        stalls_s, host_was_late = [], False
        with self.running(max(self.blocks)) as daq, self.host() as host, _without_collector():
            voltages = np.zeros(daq.block)
            usual_s = float(np.median([self.seconds(daq, lambda: daq.exchange(voltages)) for _ in range(FIRST_BLOCKS)]))
            for _ in range(self.late_blocks):
                began = time.perf_counter()
                taken_s = self.seconds(daq, lambda: daq.exchange(voltages))
                if taken_s <= usual_s + self.late_s:
                    continue
                if taken_s <= usual_s + self.late_s + host.late_s(began, time.perf_counter()):
                    host_was_late = True
                else:
                    stalls_s.append(taken_s)
                if len(stalls_s) == ENOUGH_STALLS:
                    break
        return stalls_s, host_was_late

    def test_the_clock_runs_at_the_sample_rate(self) -> None:
        """By the rows that were measured over some seconds of another clock, within 0.2 %."""
        with self.make() as daq:
            if not has_clock(daq):
                self.skip("the device has no clock of its own")
            rate_hz = daq.sample_rate_hz
        seen: list[float] = []
        for _ in range(TRIES):
            drift = self._drift()
            if SURE * drift.error > self.clock_share:
                continue  # the host was late too often
            if abs(drift.share) <= self.clock_share + SURE * drift.error:
                return
            seen.append(drift.share)
        if len(seen) < TRIES - 1:
            self.unproven(TOO_BUSY)
        off = float(np.median(seen))
        raise AssertionError(
            f"the device measures {rate_hz * (1.0 + off):.6g} samples in a second, {100.0 * off:+.2f} % from the "
            f"{rate_hz:g} Hz that are declared: allowed is {100.0 * self.clock_share:g} %"
        )

    def _drift(self) -> Drift:
        """Compare the device's count of samples with the time.

        A block may come late, never early. The earliest of each of some parts of the run lie on a line whose slope is the
        clock's error; the median of the slopes from part to part leaves out where somebody was late for long.
        """
        with self.running(max(self.blocks)) as daq, _without_collector():
            voltages, block_s = np.zeros(daq.block), daq.block / daq.sample_rate_hz
            for _ in range(FIRST_BLOCKS):
                daq.exchange(voltages)
            blocks = max(5 * BINS, math.ceil(self.clock_s / block_s))
            blocks -= blocks % BINS
            arrived_s = np.empty(blocks)
            for number in range(blocks):
                daq.exchange(voltages)
                arrived_s[number] = self.now_s(daq)
        late_s = (arrived_s - block_s * np.arange(blocks)).reshape(BINS, -1).min(axis=1)
        slopes = np.diff(late_s) / (block_s * blocks / BINS)
        slope = float(np.median(slopes))
        scatter = float(np.median(np.abs(slopes - slope)))
        return Drift(-slope / (1.0 + slope), MEDIAN_TO_ERROR * scatter / math.sqrt(slopes.size))

    def test_stop_and_close_are_prompt(self) -> None:
        """Each within a second, at the better of two tries."""
        taken_s: dict[str, list[float]] = {"stop": [], "close": []}
        for _ in range(2):
            with self.running(max(self.blocks)) as daq:
                daq.exchange(np.zeros(daq.block))
                taken_s["stop"].append(self.seconds(daq, daq.stop))
                taken_s["close"].append(self.seconds(daq, daq.close))
        for name, seconds in taken_s.items():
            assert min(seconds) <= self.prompt_s, f"{name} takes {min(seconds):.3g} s: allowed is {self.prompt_s:g} s"

    def test_a_device_that_is_gone_is_a_daq_error_and_can_be_closed(self) -> None:
        """`unplug` takes the device away: within a second exchange raises a `DaqError` that says something, and close ends."""
        daq, message = self.make(), ""
        try:
            daq.open()
            daq.start(1)
            if not self.unplug(daq):
                self.unproven("the contract has not been told how this device is unplugged (override unplug)")
            with self.host() as host:
                began = time.perf_counter()
                try:
                    for _ in range(STORED_BLOCKS):
                        before_s = self.now_s(daq)
                        daq.exchange(np.zeros(1))
                except DaqError as error:
                    message = str(error)
                assert message, "exchange went on without a device, or failed without a message"
                closing_s = self.now_s(daq)
                daq.close()
                closed_s = self.now_s(daq)
                host_late_s = host.late_s(began, time.perf_counter())
        finally:
            daq.close()
        assert daq.state is State.CLOSED, f"after close the driver is {daq.state.value}"
        for what, taken_s in (("exchange", closing_s - before_s), ("close", closed_s - closing_s)):
            if self.prompt_s < taken_s <= self.prompt_s + host_late_s:
                self.unproven(TOO_BUSY)
            assert taken_s <= self.prompt_s, (
                f"{what} takes {taken_s:.3g} s once the device is gone: allowed is {self.prompt_s:g} s"
            )

    def seconds(self, daq: DAQ, action: Callable[[], object]) -> float:
        """Time that an action takes by the clock of `now_s`, s."""
        began = self.now_s(daq)
        action()
        return self.now_s(daq) - began


@contextmanager
def _without_collector() -> Iterator[None]:
    """Keep Python from collecting garbage, which takes as long as a stall in a large process."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
