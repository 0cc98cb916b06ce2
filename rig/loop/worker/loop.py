"""The loop by the wall clock: it runs block after block, counts late blocks, and brings the output to 0 V at every end."""

import os
import struct
import time
from collections.abc import Callable
from multiprocessing.connection import Connection

import numpy as np

from rig.daq import DAQ
from rig.errors import DaqError
from rig.loop.driven_loop import DrivenLoop
from rig.loop.worker.memory import RELEASE_START, START_JUDGED, STOP, SharedMemory, Slot
from rig.loop.worker.pace import pace_of
from rig.loop.worker.times import BlockTimes, disturbances, since
from rig.tick.safety.layout import GuardMode
from rig.tick.tick import Tick

CHUNK_DONE = b"."
"""Message to the campaign with every chunk."""
NOTICE = struct.pack("!i", len(CHUNK_DONE)) + CHUNK_DONE  # format of `Connection.send_bytes`
LONGEST_STALL_S = 1.0
"""A loop paced by the host that is late by this time, or by ten blocks if longer, ends with a ramp."""
OFF = int(GuardMode.OFF)

_now = time.monotonic_ns


def suspended_s() -> float:
    """Return the seconds that the computer was suspended since its start; 0 if the system does not count them."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return 0.0 if clock is None else time.clock_gettime(clock) - time.clock_gettime(time.CLOCK_MONOTONIC)


class WallClockLoop(DrivenLoop):
    """Runs a tick over a started driver, and hands its rows to another process chunk by chunk.

    ``tick`` has its state in ``state`` (`rig.loop.worker.memory.packed`). ``asked`` returns who has asked the process to end.
    Every request to end (by the campaign, a signal, a full ring, a campaign process that is gone, a suspended computer) starts
    the tick's ramp to 0 V; ``cause`` says who requested it, unless it was the campaign. ``disturbances`` counts events that
    may have delayed the loop.
    """

    def __init__(
        self, daq: DAQ, tick: Tick, state: np.ndarray, memory: SharedMemory, facts: Connection, asked: Callable[[], str]
    ) -> None:
        super().__init__(daq, tick)
        self._state, self._memory, self._asked = state, memory, asked
        self._facts_descriptor = facts.fileno()
        self._parent = os.getppid()
        self._alone = False
        self._slept_s = suspended_s()
        self._pace = pace_of(daq)
        period_ns = 1e9 * daq.block / daq.sample_rate_hz
        queue = daq.queue_blocks if self._pace.by_device else 1
        self.deadline_ns = int(period_ns * max(1, queue))
        """Longest allowed time from the release of a block to the output of its voltages, ns."""
        self.times = BlockTimes(self._pace, memory, self.deadline_ns)
        self._stall_ns = int(max(1e9 * LONGEST_STALL_S, 10 * period_ns))
        self._unsaid = False
        self._began_ns = 0
        self._filled: tuple[Slot, int] | None = None
        # Spread over the blocks of a chunk, as each chore costs as much time as a block.
        chores = [self._hand_over, self._look_round, self._announce]
        spread = memory.layout.chunk >= len(chores) * daq.block
        self._chores = dict(enumerate(chores)) if spread else {0: self._all_chores}
        slot, block = memory.to_fill(), daq.block
        self._tick_block = self._bound_tick(slot.readings[:block], slot.rows[:block])
        self._samples = 0
        self.disturbances: dict[str, int] = {}

    def run(self) -> None:
        """Run until the output is off."""
        before = disturbances()
        self._began_ns = _now()
        self._pace.begin()
        over = False
        while not over:
            self._wait_for_judgement()
            self._fill()
            over = self.failure is not None or self.tick.over
            if over:
                self.stop()  # the next outputs first, the rows after them
            self._hand_over()
        self._announce()
        self.disturbances = since(before)

    def _fill(self) -> None:
        """Fill slots block by block, in lockstep one, else until the loop ends; the last one is still to be handed over.

        The chores of a chunk, one a block, are done where no time is lost: where the device paces, once outputs are sent and
        the block is awaited (`DAQ.do_meanwhile`), else before the next block is due. The first is to hand over the slot before.
        """
        tick, daq, words, pace, voltages = self.tick, self.daq, self._memory.words, self._pace, self._voltages
        told = daq.put_out, daq.continuation
        arrays, block, blocks = tick.arrays, daq.block, self._memory.layout.chunk // daq.block
        chores, tick_block, begun_at = self._chores, self._tick_block, self.times.begun
        guard = arrays.guard.view(np.int64).data
        number, slot = 0, None
        while True:
            if words[STOP]:
                tick.request_stop()
            if words[RELEASE_START]:
                tick.release_start()
            if number > 0 and self._judgement_is_due():
                break
            self._account()
            if number in chores:
                daq.meanwhile = chores[number]
                if not pace.by_device:
                    daq.do_meanwhile()
                    if self.failure is not None:  # the ring may be full
                        break
            begun = pace.wait()
            swapped = self._swap()
            if daq.meanwhile is not None:  # the driver was refused before it had begun
                daq.do_meanwhile()
            if swapped is None or self.failure is not None:
                break
            begun = begun or _now()
            if slot is None:
                slot = self._memory.to_fill()
            first = number * block
            readings, rows = slot.readings[first : first + block], slot.rows[first : first + block]
            inputs, flags = swapped
            tick_block(arrays, inputs, flags, readings, rows, voltages, *told)
            begun_at(begun)
            self._samples += block
            number += 1
            if guard[0] == OFF and tick.over:
                self._account()
                break
            if number == blocks:
                if not pace.has_clock:
                    break
                self._filled = slot, number * block
                number, slot = 0, None
        if slot is not None or self._filled is None:
            self._filled = self._memory.to_fill() if slot is None else slot, number * block

    def _judgement_is_due(self) -> bool:
        """Whether, in lockstep, a judgement of the start is due and has still to come."""
        if self._pace.has_clock or not self.tick.start_held:
            return False
        return self.tick.start_judgements > self._memory.words[START_JUDGED]

    def _wait_for_judgement(self) -> None:
        """Wait, in lockstep, for a judgement of the start that is due: the same rows come of every run.

        Where a clock runs on, the start lasts longer instead.
        """
        while self._judgement_is_due():
            self._announce()
            words = self._memory.words
            if words[RELEASE_START]:
                self.tick.release_start()
            elif words[STOP] or os.getppid() != self._parent or self._asked():
                return
            else:
                time.sleep(0.001)

    def _account(self) -> None:
        response = self.times.done()
        if response > self._stall_ns and not self._pace.by_device:
            self._end(f"the loop stalled for {1e-9 * response:.1f} s")

    def _hand_over(self) -> None:
        """Complete the chunk that was filled last, if there is one; it is still to be announced.

        If the campaign is gone, the same slot is filled again. If the ring is full, the campaign may still read that slot.
        """
        if self._filled is None:
            return
        (slot, rows), self._filled = self._filled, None
        self._announce()  # the previous chunk, if this one ended before it was announced
        if self._alone or self._memory.free < 1:
            return
        slot.head[:] = rows, self._samples, self.times.overruns, self.times.busy_ns, _now() - self._began_ns
        counts = list(self.counters.values())[: slot.counters.size]
        slot.counters[: len(counts)] = counts
        slot.state[:] = self._state
        self._memory.publish()
        self._unsaid = True

    def _announce(self) -> None:
        if not self._unsaid:
            return
        self._unsaid = False
        try:
            os.write(self._facts_descriptor, NOTICE)
        except OSError:
            self._alone = True

    def _all_chores(self) -> None:
        self._hand_over()
        self._look_round()
        self._announce()

    def _look_round(self) -> None:
        if os.getppid() != self._parent:
            self._alone = True
        if self._alone:
            self._end("the campaign's process is gone")
        elif self._memory.free <= self._memory.layout.reserve and not self._waited_for_room():
            self._end("the campaign did not take its rows, and the output was brought down before any was lost")
        if not self._alone and self._memory.free < 1:  # longer than a ramp has passed
            self._fail(DaqError("the campaign did not take its rows, and there is no room for more"))
        asked = self._asked()
        if asked:
            self._end(asked)
        slept = suspended_s()
        if slept - self._slept_s > 0.05:
            self._end(f"the computer was suspended for {slept - self._slept_s:.1f} s")
        self._slept_s = slept

    def _waited_for_room(self) -> bool:
        """Wait until the campaign has taken a chunk; only in lockstep, where no clock runs on."""
        if self._pace.has_clock:
            return False
        while self._memory.free <= self._memory.layout.reserve:
            if os.getppid() != self._parent or self._asked() or self._memory.words[STOP]:
                break
            time.sleep(0.01)
        return True

    def _end(self, cause: str) -> None:
        """Request the ramp, with a cause; the first cause is kept."""
        if not self.cause and not self._memory.words[STOP] and int(self.tick.guard["mode"][0]) == GuardMode.ARMED:
            self.cause = cause
        self.tick.request_stop()
