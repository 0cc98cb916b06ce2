"""The buffer thread: it keeps the device's output buffer filled, whether or not the loop hands over outputs in time.

A device that generates without regeneration stops where its buffer runs dry, at whatever voltage it has then. What the loop
has handed over is written as soon as it is there, ``queue`` blocks before it is due: the thread waits for it, but for no
longer than a part of a block after inputs have come. Then, outputs up to ``n + 1 + ahead`` are written once inputs n have
come, in place of missing ones what continues the last period (`rig.continuation`), or the last output. So the loop has
``queue - ahead`` blocks of time; the thread has ``queue`` blocks where the loop is in time, and ``ahead`` where it is not.

A loop that has handed over nothing for the time of the watchdog is stuck: the thread brings the output to 0 V by a raised
cosine and ends.
"""

import math
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from rig.continuation import SOURCE, begin, count_at, keep, ring_for
from rig.drivers.nidaqmx.library import as_ni_error
from rig.drivers.nidaqmx.tasks import Stream
from rig.errors import DaqError, DaqTimeout, DaqWatchdog
from vibrolock.arrays import Float
from vibrolock.compiled import Record, kernel

FULL_SCALE = 1 << 23
"""Counts of the largest output where outputs are continued: 24 bits, below the noise of any output."""
HELD, CONTINUED = 1, 2
"""Bits of the flags of a block's outputs."""
SWITCH_S = 2e-4
"""Time after which a thread of Python lets another one run, s: 5 ms, as it is by itself, is a block of 64 at 12.8 kHz."""
PATIENCE = 0.5
"""Part of a block for which the thread waits for the loop's answer to a block of inputs; chosen: the next comes after that."""
WAITS = 4
"""Parts in which a block is waited for: a process that was stopped has used up one of them, not the whole time."""
ENDING_S = 2.0
"""Longest wait beyond the ramp for the thread to end, s; chosen."""


class Plan(NamedTuple):
    """How blocks are exchanged; times in samples."""

    block: int
    inputs: int
    ahead: int
    """Blocks that lie ahead in the device's buffer where the loop is late."""
    queue: int
    """Blocks between handing over an output and the converter: ``ahead`` and those of the loop."""
    watchdog: int
    ramp: int
    longest_period: int
    output_range_v: float
    timeout_s: float
    rate_hz: float
    lockstep: bool
    """Whether to wait for the loop, in place of continuing."""


class Block(NamedTuple):
    """A block that has been exchanged; arrays that are overwritten later."""

    inputs: Float
    """Readings [n_channels, n], V."""
    raised: int
    """Flags of its outputs: ``HELD``, ``CONTINUED`` or none."""
    put_out: Float
    """What was put out [n], V."""


@kernel
def _continue(source: Record, ring: np.ndarray, first: int, out: np.ndarray, v_per_count: float) -> None:
    """Fill outputs [n] that are due from sample ``first`` on with what continues the last period."""
    for index in range(out.size):
        out[index] = v_per_count * count_at(source, ring, first + index)


class BufferThread:
    """Exchanges blocks with a device in a thread of its own; the first `hand_over` starts both.

    ``feed`` is called before the start and with each block.
    """

    def __init__(self, stream: Stream, plan: Plan, feed: Callable[[], None] | None = None) -> None:
        self._stream, self._plan, self._feed = stream, plan, feed
        size = plan.queue + 8 + math.ceil((plan.watchdog + plan.ramp) / plan.block)
        self._inputs = np.zeros((size, plan.inputs, plan.block))
        self._handed = np.zeros((size, plan.block))
        self._goes_on = np.zeros((size, 2), np.int64)
        self._put_out = np.zeros((size, plan.block))
        self._raised = np.zeros(size, np.int64)
        self._source, self._history = np.zeros(1, SOURCE), ring_for(plan.longest_period)
        self._counts = np.zeros(plan.block, np.int64)
        self._v_per_count = plan.output_range_v / FULL_SCALE
        keep(self._source[0], self._history, 0, self._counts, 0, 0)  # compiles
        _continue(self._source[0], self._history, 0, np.zeros(0), 1.0)
        begin(self._source[0], plan.longest_period)
        self._size = size
        self._n_handed = self._n_kept = self._n_read = self._n_taken = 0
        self._written = plan.queue  # blocks of 0 V that lie in the buffer at the start
        self._zeros = self._written
        self._held_v = 0.0
        self._fade_at = -1
        self._is_ending = self._tripped = False
        self._failure: DaqError | None = None
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    # What the loop calls

    def hand_over(self, volts: Float, period: int, ramp: int) -> None:
        """Hand over the next block [n], V; how it goes on as in `rig.continuation.keep`."""
        at = self._n_handed % self._size
        self._handed[at] = volts
        self._goes_on[at] = period, ramp
        with self._changed:
            self._n_handed += 1
            self._changed.notify_all()
        if self._thread is None:
            sys.setswitchinterval(SWITCH_S)
            self._thread = threading.Thread(target=self._run, name="nidaqmx buffer", daemon=True)
            self._thread.start()

    def take(self) -> Block:
        """Wait for the next block of inputs. Raises the `DaqError` with which the thread has ended."""
        plan, number = self._plan, self._n_taken
        patience_s = 2.0 * plan.timeout_s + plan.block / plan.rate_hz
        with self._changed:
            for _ in range(WAITS):
                if self._changed.wait_for(
                    lambda: self._n_read > number or self._failure is not None, patience_s / WAITS
                ):
                    break
        if self._n_read <= number:
            if self._failure is not None:
                raise self._failure
            raise DaqTimeout(f"the device has not answered for {patience_s:g} s (driver.options.timeout_s)")
        self._n_taken += 1
        at = number % self._size
        return Block(self._inputs[at], int(self._raised[at]), self._put_out[at])

    @property
    def is_over(self) -> bool:
        """Whether the thread has ended."""
        return self._failure is not None

    @property
    def is_ending(self) -> bool:
        """Whether the output is being brought to 0 V, or is there."""
        return self._is_ending

    def end(self) -> None:
        """Bring the output to 0 V, and end the thread."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        with self._changed:
            self._is_ending = True
            self._changed.notify_all()
        plan = self._plan
        longest_s = (plan.ramp + 2 * (plan.queue + 2) * plan.block) / plan.rate_hz + ENDING_S
        thread.join(longest_s + (plan.timeout_s if not plan.lockstep else 0.0))

    # What the thread does

    def _run(self) -> None:
        try:
            if self._feed is not None:
                self._feed()  # a watchdog is started before the tasks run
            self._stream.start()
            while not self._is_silent():
                self._exchange()
            failure: DaqError | None = None
        except Exception as error:
            failure = as_ni_error(error, "")
            with suppress(Exception):
                self._fade_out()
        with self._changed:
            if self._tripped:
                failure = DaqWatchdog(
                    "no output had come in time and the driver has brought the output to 0 V (driver.options.watchdog_s)"
                )
            self._failure = failure or DaqError("the tasks have ended")
            self._changed.notify_all()

    def _is_silent(self) -> bool:
        """Whether everything is 0 V that is or will be put out."""
        return (self._is_ending or self._tripped) and self._zeros > self._plan.queue + 1

    def _exchange(self) -> None:
        """Read the next block of inputs, and write the outputs that have been handed over, or are due."""
        plan, number = self._plan, self._n_read
        least = number + 2 + plan.ahead
        self._stream.read(self._inputs[number % self._size])
        with self._changed:
            self._n_read += 1
            self._changed.notify_all()
        if not plan.lockstep:
            self._write(least)
        with self._changed:
            patience_s = None if plan.lockstep else PATIENCE * plan.block / plan.rate_hz
            self._changed.wait_for(lambda: self._n_handed > number + 1 or self._is_ending, patience_s)
        self._write(max(least, self._n_handed + plan.queue))
        if self._feed is not None:
            self._feed()

    def _write(self, upto: int) -> None:
        """Write in one call what is missing of so many blocks since the start."""
        if upto <= self._written:
            return
        handed = self._n_handed
        self._keep(handed)
        blocks = [self._next(number, handed) for number in range(self._written, upto)]
        self._stream.write(blocks[0] if len(blocks) == 1 else np.concatenate(blocks))
        self._written = upto

    def _next(self, number: int, handed: int) -> Float:
        """Return block ``number`` of the outputs [n], V, with ``handed`` blocks of the loop."""
        plan, at, first = self._plan, number % self._size, number * self._plan.block
        volts: Float = self._put_out[at]
        due = number - plan.queue
        if due < 0:
            volts[:], raised = 0.0, 0
        elif due < handed:
            volts[:], raised = self._handed[due % self._size], 0
        elif self._source[0]["period"] > 0:
            _continue(self._source[0], self._history, first, volts, self._v_per_count)
            raised = CONTINUED
        else:
            volts[:], raised = self._held_v, HELD
        silent = not plan.lockstep and due - handed >= plan.watchdog / plan.block
        if self._fade_at < 0 and (silent or self._is_ending):
            self._fade_at, self._tripped = first, silent and not self._is_ending
        self._held_v = float(volts[-1])
        if self._fade_at >= 0:
            done = np.minimum((np.arange(first, first + plan.block) - self._fade_at) / max(1, plan.ramp), 1.0)
            volts *= 0.5 + 0.5 * np.cos(np.pi * done)
        self._raised[at] = raised
        self._zeros = 0 if volts.any() else self._zeros + 1
        return volts

    def _keep(self, handed: int) -> None:
        """Keep what has been handed over, late or not, for what may have to be continued."""
        plan = self._plan
        for number in range(self._n_kept, handed):
            at = number % self._size
            np.rint(self._handed[at] / self._v_per_count, out=self._counts, casting="unsafe")
            period, ramp = self._goes_on[at].tolist()
            keep(self._source[0], self._history, (number + plan.queue) * plan.block, self._counts, period, ramp)
        self._n_kept = handed

    def _fade_out(self) -> None:
        """Bring the output to 0 V where inputs no longer come but outputs still go, and wait until it is there."""
        self._is_ending = True
        while not self._is_silent():
            self._write(self._written + 1)
        plan, waited = self._plan, threading.Event()
        blocks = math.ceil((plan.ramp / plan.block) + plan.queue + 4)
        for _ in range(blocks):
            if self._stream.generated() >= (self._written - plan.queue - 1) * plan.block:
                return
            waited.wait(plan.block / plan.rate_hz)
