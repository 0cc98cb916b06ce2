"""A loop that runs on the device at the other end of a wire: its records go there, its rows and its state come back."""

import math
from collections import deque
from collections.abc import Mapping
from zlib import crc32

import numpy as np

from rig.drivers.wire.connection import Connection
from rig.drivers.wire.dialogue import why_not
from rig.drivers.wire.incoming import Incoming
from rig.drivers.wire.options import WireOptions, loop_watchdog_s
from rig.drivers.wire.streaming import FLAG_NAMES, set_up
from rig.errors import DaqProtocol, DaqRefused
from rig.tick.layout import TickArrays
from rig.tick.sequencer.layout import SEGMENT
from rig.wire.messages import (
    ARM_KEY,
    LARGEST_PIECE,
    LOOP_PINGS_HZ,
    Answer,
    Command,
    Parameter,
    Record,
    Rows,
    State,
    Status,
    Stream,
)

UPLOADS = 5  # of an array until the line counts as damaged; chosen
STATE_EVERY_S = 0.1  # in which the device tells its state at least once; chosen: a state takes as much as 27 rows
PING_LOST_S = 1.0  # until an unanswered ping counts as lost; chosen
ALIGNMENT = 8  # bytes, of the arrays in the device
REASONS = {
    1: "has another size than it must have",
    2: "does not fit the other records or the device's channels",
    3: "holds an index or a code out of range",
    4: "holds a number that is none",
    5: "has another sample rate than the device",
    6: "has a voltage limit beyond the device's converter",
}
"""Why a device refuses records, by the low byte of `Parameter.TICK_FAULT`."""


def why_no_rows(connection: Connection, n_channels: int, rate_hz: float, block: int) -> str:
    """Why the wire does not carry the rows of a loop on the device, with the sum; empty if it does."""
    assert connection.facts is not None
    stream = _stream(n_channels, block, rate_hz, connection.facts.bits)
    if why := connection.link.why_no_rows(stream):
        return why
    if connection.lacks_room:
        return (
            f"{connection.link.name}: the wire has no room for version 2 of the protocol, of which the loop is a part"
        )
    return connection.why_not_carried(stream)


def _stream(n_channels: int, block: int, rate_hz: float, bits: int) -> Stream:
    state_blocks = max(1, math.floor(STATE_EVERY_S * rate_hz / block))
    return Stream(n_channels, block, rate_hz, bits, 1, True, state_blocks)


def why_no_room(connection: Connection, sizes: Mapping[str, int]) -> str:
    """Why the device does not hold records of these sizes (bytes, by name), with the sum; empty if it does."""
    room = connection.dialogue.get(Parameter.TICK_ROOM)
    needed = sum(-(-size // ALIGNMENT) * ALIGNMENT for size in sizes.values())
    if needed <= room:
        return ""
    largest = max(sizes, key=lambda name: sizes[name])
    return (
        f"{connection.link.name}: the plan takes {needed} bytes in the device, {sizes[largest]} of them {largest} "
        f"({sizes['segments'] // SEGMENT.itemsize} segments), and it has room for {room}"
    )


class RemoteLoop:
    """One run of a loop on the device; `begin` starts it.

    The records are those of `rig.tick.tick.Tick.arrays`, byte for byte. Errors: those of `rig.errors`, each in one line that
    begins with the name of the port.
    """

    def __init__(
        self, connection: Connection, rate_hz: float, block: int, options: WireOptions, arrays: TickArrays
    ) -> None:
        facts = connection.facts
        assert facts is not None
        self._connection, self._dialogue, self._arrays = connection, connection.dialogue, arrays
        self._name = connection.link.name
        connection.set(Parameter.BLOCK, 1, "block", 1, "samples")  # the largest one depends on who runs the loop
        connection.set(Parameter.LOOP, 1, "driver.options.loop", 1, "")
        self.block = min(block, self._dialogue.get(Parameter.LARGEST_BLOCK))
        """Rows that the device sends at a time."""
        stream = _stream(len(facts.names), self.block, rate_hz, facts.bits)
        tells = self._dialogue.ask(Command.SET, Parameter.STATE_BLOCKS, value=stream.state_blocks)
        if tells.status != Status.DONE:  # it tells its state with every block
            stream = stream._replace(state_blocks=1)
        connection.check_capacity(stream)
        connection.check_latch()
        wait_s = loop_watchdog_s(options, facts.watchdog_s, moves=not facts.simulated)
        set_up(connection, stream, wait_s, options.ramp_s)
        self._upload()
        timeout_s = options.timeout_s or max(0.25, 10.0 * stream.block / stream.rate_hz)
        self._dialogue.early.clear()
        longest_gap = math.ceil((wait_s + timeout_s) * stream.rate_hz) + stream.block
        self.incoming = Incoming(
            self._dialogue, (stream.block, stream.n_channels), longest_gap, timeout_s, facts.boot, kind=Rows
        )
        self.incoming.on_answer, self.incoming.on_state = self._take_answer, self._note
        self._states: deque[State] = deque(maxlen=64)
        self.flag_counts = dict.fromkeys(FLAG_NAMES, 0)
        """Samples by device flag."""
        self._blocks = 0
        self._blocks_between_pings = max(1, round(stream.rate_hz / stream.block / LOOP_PINGS_HZ))
        self._ping: tuple[int, float] | None = None

    def begin(self) -> None:
        """Start the loop, and arm the device."""
        self._dialogue.forget()
        answer = self._dialogue.ask(Command.START)
        if answer.status == Status.NOT_ALLOWED:
            place, reason = divmod(answer.value, 256)
            name = TickArrays._fields[place] if place < len(TickArrays._fields) else f"array {place}"
            why = REASONS.get(reason, f"is refused for reason {reason}")
            raise DaqRefused(f"{self._name}: the device does not run this plan: its record {name!r} {why}")
        if answer.status != Status.DONE:
            raise DaqRefused(f"{self._name}: the loop was not started: {why_not(answer)}")
        self._dialogue.do(Command.ARM, value=ARM_KEY)
        self._dialogue.forget_beats()  # those sent before the device was armed

    def take(self) -> tuple[Rows | None, State | None]:
        """The next block of rows, None if it was lost, and the state at its end, None if that was lost."""
        self._blocks += 1
        overdue = self._ping is None or self._connection.clock() - self._ping[1] > PING_LOST_S
        if overdue and self._blocks % self._blocks_between_pings == 0:
            request = self._dialogue.next_request(Command.GET, Parameter.PING, self._blocks & 0xFF)
            self._ping = request.number, self._connection.clock()
            self._connection.link.send(request)
        rows = self.incoming.take()
        if rows is None:
            return None, None
        if rows.flags:
            for bit, name in enumerate(FLAG_NAMES):
                if rows.flags & (1 << bit):
                    self.flag_counts[name] += self.block
        end, state = rows.first + self.block, None
        while self._states and self._states[0].sample <= end:
            state = self._states.popleft()
        return rows, state if state is not None and state.sample == end else None

    @property
    def expected(self) -> int:
        """Index of the first sample of the next block."""
        return self.incoming.expected

    def ramp(self) -> None:
        """Ask for the ramp to 0 V."""
        self._dialogue.do(Command.RAMP)

    def release(self) -> None:
        """Let the start segment end at its time."""
        self._dialogue.do(Command.RELEASE)

    def agrees(self, name: str, array: np.ndarray) -> bool:
        """Whether an array of the records lies in the device as it lies here."""
        place = TickArrays._fields.index(name)
        return self._dialogue.get(Parameter.TICK_CRC, place) == crc32(array.tobytes())

    def stop(self) -> None:
        """Stop the device: 0 V, no more rows."""
        self._dialogue.do(Command.STOP)
        self._dialogue.early.clear()

    def _note(self, state: State) -> None:
        self._states.append(state)

    def _take_answer(self, answer: Answer) -> None:
        if self._ping is not None and answer.number == self._ping[0]:
            self._connection.round_trips.add(self._connection.clock() - self._ping[1])
            self._ping = None
        else:
            self._dialogue.note_stray(answer)

    def _upload(self) -> None:
        contents = [array.tobytes() for array in self._arrays]
        sizes = {name: len(content) for name, content in zip(TickArrays._fields, contents, strict=True)}
        if why := why_no_room(self._connection, sizes):
            raise DaqRefused(why)
        for place, content in enumerate(contents):
            self._set(Parameter.TICK_BYTES, place, len(content))
        self._set(Parameter.TICK_PERIOD, 0, self._arrays.waveforms.shape[1])
        for place, content in enumerate(contents):
            self._send(place, content)

    def _set(self, parameter: Parameter, item: int, value: int) -> None:
        answer = self._dialogue.ask(Command.SET, parameter, item, value)
        if answer.status != Status.DONE:
            what = TickArrays._fields[item] if parameter == Parameter.TICK_BYTES else "a waveform"
            raise DaqRefused(f"{self._name}: {what} of {value} is not what the device takes: {why_not(answer)}")

    def _send(self, place: int, content: bytes) -> None:
        for _ in range(UPLOADS):
            for first in range(0, len(content), LARGEST_PIECE):
                self._connection.link.send(Record(place, first, content[first : first + LARGEST_PIECE]))
            if self._dialogue.get(Parameter.TICK_CRC, place) == crc32(content):
                return
        raise DaqProtocol(
            f"{self._name}: {TickArrays._fields[place]} did not reach the device whole in {UPLOADS} tries"
            f"{self._dialogue.damage()}"
        )
