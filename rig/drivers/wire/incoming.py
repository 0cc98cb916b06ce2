"""Blocks from the wire, put in order: lost blocks are reported as gaps; repeated and late blocks are counted and skipped."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from rig.drivers.wire.dialogue import Dialogue
from rig.errors import DaqEmergencyStop, DaqProtocol, DaqReset, DaqTimeout, DaqWatchdog
from rig.wire.messages import (
    LOWEST_VERSION,
    MISSED,
    STOPPED,
    Answer,
    DeviceFlag,
    DeviceState,
    Heartbeat,
    Message,
    Readback,
    Rows,
    Samples,
    State,
)

OLD_BLOCKS_IN_A_ROW = 3  # consecutive old blocks after which the device must have started to count anew
UNARMED_BEATS = 2  # the first may have been sent before the device was armed
UNARMED = {
    int(DeviceState.IDLE): "was stopped by another program",
    int(DeviceState.RUNNING): "was disarmed by another program",
}
REMEMBERED = 4  # blocks that were given up (one of them that comes after all is late, not repeated), and readbacks
LOOKS = 2  # before the device of a loop counts as silent: the computer may have stood still during the first
MOST_LOOKED_AT = 64  # messages that are looked through for a block that another has overtaken


Block = TypeVar("Block", Samples, Rows)


class Incoming(Generic[Block]):
    """The blocks of a streaming device one by one: samples, or rows where the device runs the loop.

    ``shape`` is that of a block. A gap of more than ``longest_gap`` samples is an error: the watchdog would have ended the
    stream before. In version 2 of the protocol a block in which an output was missing comes with a readback, or is a gap.
    A block that the next one has overtaken is put in its place if it is there or comes within ``patience_s``, and before a
    third one.

    Errors: `DaqTimeout`, `DaqProtocol`, `DaqReset`, `DaqWatchdog`, `DaqEmergencyStop`.
    """

    def __init__(
        self,
        dialogue: Dialogue,
        shape: tuple[int, int],
        longest_gap: int,
        timeout_s: float,
        boot: int,
        patience_s: float = 0.0,
        *,
        kind: type[Block] = Samples,  # type: ignore[assignment]  # what most devices send
    ) -> None:
        self._dialogue, self._link, self._clock = dialogue, dialogue.link, dialogue.clock
        self._shape, self._block, self._longest_gap = shape, shape[0], longest_gap
        self._boot, self._timeout_s, self._patience_s = boot & 0xFF, timeout_s, patience_s
        self._kind: type[Block] = kind
        self.on_answer: Callable[[Answer], None] = dialogue.note_stray
        self.on_state: Callable[[State], None] | None = None
        """Takes the state of a loop on the device."""
        self.expected = 0
        """Index of the first sample of the next block."""
        self.blocks = 0
        self.lost_samples = 0
        self.repeated_blocks = 0
        self.missing_readbacks = 0
        self.put_out: np.ndarray | None = None
        """Counts [n] that were put out during the block returned last; None where no output was missing."""
        self.reordered_blocks = 0
        """Blocks that the next one had overtaken, and that were put in their place."""
        self.late_blocks = 0
        """Blocks that came after they had been given up."""
        self.misplaced_blocks = 0
        self.dropped = 0
        self._newer: deque[Block] = deque()
        self._given_up: deque[int] = deque(maxlen=REMEMBERED)
        self._readbacks: dict[int, Readback] = {}
        self._untold: dict[int, Block] = {}
        self._reads_back = dialogue.link.version > LOWEST_VERSION
        self._old_in_a_row = 0
        self._last_old = 0
        self._unarmed_beats = 0

    def take(self) -> Block | None:
        """The next block; None if it was lost, which shows when a newer block arrives."""
        newer = self._newer
        if not newer:
            newer.append(self._wait())
        if newer[0].first == self.expected + self._block:
            self._look_for_the_one_before(newer[0].first)
        samples = None
        if newer[0].first == self.expected:
            samples = newer.popleft()
            self.blocks += 1
            readback = self._readbacks.get(samples.first) if samples.flags & MISSED else None
            self.put_out = readback.counts if readback is not None else None
        else:
            self.lost_samples += self._block
            self.missing_readbacks += self.expected in self._untold
            self._given_up.append(self.expected)
        self._untold.pop(self.expected, None)
        self.expected += self._block
        return samples

    def _look_for_the_one_before(self, first: int) -> None:
        """Wait a little for the expected block, which that at ``first`` may have overtaken, and not beyond a further one."""
        until = self._clock() + self._patience_s
        left_s = self._patience_s
        for _ in range(MOST_LOOKED_AT):
            message = self._next(left_s)
            if message is None:
                return
            if not isinstance(message, self._kind):
                self._other(message)
            elif message.first == first:
                self.repeated_blocks += 1
            elif self._is_good(message):
                if message.first == self.expected:
                    self._newer.appendleft(message)
                    self.reordered_blocks += 1
                else:
                    self._newer.append(message)
                return
            left_s = max(until - self._clock(), 0.0) if left_s else 0.0

    def _next(self, timeout_s: float) -> Message | None:
        """The next message; a block in which an output was missing comes again once its readback is there."""
        early = self._dialogue.early
        message = early.popleft() if early else self._link.receive(timeout_s)
        if not isinstance(message, Readback):
            return message
        if len(self._readbacks) >= REMEMBERED:
            del self._readbacks[next(iter(self._readbacks))]
        self._readbacks[message.first] = message
        return self._untold.pop(message.first, message)

    def _wait(self) -> Block:
        until, looks = 0.0, LOOKS if self._kind is Rows else 1
        waited_s = looks * self._timeout_s
        left_s, kind = self._timeout_s, self._kind
        while True:
            message = self._next(left_s)
            if isinstance(message, kind):
                if self._is_good(message):
                    return message
            elif message is not None:
                self._other(message)
            now = self._clock()
            until = until or now + self._timeout_s
            left_s = until - now
            if message is not None and left_s > 0.0:
                continue
            looks -= 1
            until, left_s = 0.0, self._timeout_s
            if not looks:
                raise DaqTimeout(
                    f"{self._link.name}: the block at sample {self.expected} has not come within {waited_s:g} s"
                    f"{self._dialogue.damage()}; the device is silent or its cable is damaged"
                )

    def _is_good(self, samples: Block) -> bool:
        first, block = samples.first, self._block
        if samples.flags & STOPPED:
            self._raise_stopped(samples.flags)
        if samples.dropped > self.dropped:
            self.dropped = samples.dropped
        if first >= self.expected and first % block == 0 and samples.shape == self._shape:
            if first - self.expected > self._longest_gap:
                raise DaqProtocol(
                    f"{self._link.name}: the device jumps from sample {self.expected} to {first}, "
                    "further than its watchdog lets it run alone"
                )
            self._old_in_a_row = 0
            return self._is_told(samples)
        if first >= self.expected:
            self.misplaced_blocks += 1
            return False
        if first in self._given_up:
            self._given_up.remove(first)
            self.late_blocks += 1
            return False
        self.repeated_blocks += 1
        follows = first == self._last_old + block
        self._old_in_a_row = self._old_in_a_row + 1 if follows and self._old_in_a_row else 1
        self._last_old = first
        if self._old_in_a_row >= OLD_BLOCKS_IN_A_ROW:
            raise DaqReset(
                f"{self._link.name}: the device has restarted its sample count, from {first}: it was started by another program"
            )
        return False

    def _is_told(self, samples: Block) -> bool:
        """Whether a block in which an output was missing came with what was put out instead; version 1 tells that never."""
        if not self._reads_back or not samples.flags & MISSED or samples.first in self._readbacks:
            return True
        if len(self._untold) >= REMEMBERED:
            del self._untold[next(iter(self._untold))]
        self._untold[samples.first] = samples
        return False

    def _other(self, message: Message) -> None:
        if isinstance(message, Answer):
            self.on_answer(message)
        elif isinstance(message, State):
            if self.on_state is not None:
                self.on_state(message)
        elif isinstance(message, Heartbeat):
            if message.boot != self._boot:
                raise DaqReset(f"{self._link.name}: the device restarted during the run; its output is 0 V")
            if message.flags & STOPPED:
                self._raise_stopped(message.flags)
            self._unarmed_beats = self._unarmed_beats + 1 if message.state != DeviceState.ARMED else 0
            if self._unarmed_beats >= UNARMED_BEATS:
                how = UNARMED.get(message.state, f"is in state {message.state} and not armed")
                raise DaqReset(f"{self._link.name}: the device {how}; its output is 0 V")

    def _raise_stopped(self, flags: int) -> None:
        if flags & DeviceFlag.EMERGENCY_STOP:
            raise DaqEmergencyStop(
                f"{self._link.name}: the emergency stop has brought the output to 0 V; release it first"
            )
        raise DaqWatchdog(
            f"{self._link.name}: the device's watchdog has brought the output to 0 V, for no output had come in time "
            f"(driver.options.watchdog_s){self._dialogue.damage()}"
        )
