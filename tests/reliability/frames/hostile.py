"""Runs over a wire at whose one end hostile frames arrive among the valid ones."""

import random
import resource
from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np

from rig.daq import LOST
from rig.drivers.wire import WireOptions
from rig.errors import DaqError
from rig.wire.link import Link
from rig.wire.messages import DeviceState, Message, Stream
from tests.reliability.frames.lines import LINES
from tests.rig.drivers.test_wire import virtual, voltages
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ, MemoryLink, MemoryWire

ENDS = ("host", "device")
MODES = ("damaged", "forged")
"""Frames that the wire can tell from right ones; frames of any content that are right in their form."""
BLOCK, BLOCKS, QUEUE, SEED = 5, 60, 2, 3
ALIKE_S = 3.0
"""After which a device without a host has come to rest: watchdog and ramp."""


@dataclass
class Counts:
    """What came of so many hostile bytes."""

    n_bytes: int = 0
    frames: int = 0
    runs: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    """Runs by how they ended: carried out, or the error's type."""
    rows_wrong: int = 0
    """Rows of a damaged line that are neither right nor a gap."""
    wrong: list[str] = field(default_factory=list)
    grown_mb: float = 0.0


class _Hostile:
    """What happens to messages on their way to one end."""

    def __init__(self, wire: str, end: str, mode: str, chance: random.Random, counts: Counts, n_channels: int) -> None:
        self.line = LINES[wire](n_channels, end == "device")
        self.mode, self.chance, self.counts = mode, chance, counts
        self._seen: deque[bytes] = deque(maxlen=200)

    def passed(self, message: Message) -> list[Message]:
        """The messages that arrive in its place."""
        frames = self.line.encode(message)
        self._seen.extend(frames)
        return [arrived for data in self._spoilt(frames) for arrived in self.line.decode(data)]

    def _spoilt(self, frames: list[bytes]) -> list[bytes]:
        out: list[bytes] = []
        for data in frames:
            if self.mode == "damaged":
                out.append(self._told(self.line.damaged(data, self.chance), len(data)) if self._hit() else data)
                continue
            for _ in range(self.chance.choice((0, 0, 1, 10, 100))):
                out.append(self._told(self.line.forged(self.chance.choice(self._seen), self.chance)))
            out.append(data)
        return out

    def _hit(self) -> bool:
        return self.chance.random() < 0.1

    def _told(self, data: bytes, least: int = 0) -> bytes:
        self.counts.n_bytes += max(len(data), least)  # a frame that is lost counts as well
        self.counts.frames += 1
        return data


class _Link(MemoryLink):
    """The host's end of a wire whose one direction is hostile."""

    def __init__(self, wire: MemoryWire, end: str, hostile: _Hostile) -> None:
        super().__init__(wire, host=True)
        self._end, self._hostile = end, hostile
        self._arrived: deque[Message] = deque()

    def configure(self, stream: Stream) -> None:
        super().configure(stream)
        self._hostile.line.configure(stream)

    def send(self, message: Message) -> None:
        if self._end == "host":
            super().send(message)
            return
        for arrived in self._hostile.passed(message):
            super().send(arrived)

    def receive(self, timeout_s: float) -> Message | None:
        if self._end == "device":
            return super().receive(timeout_s)
        while not self._arrived:
            message = super().receive(timeout_s)
            if message is None:
                return None
            self._arrived.extend(self._hostile.passed(message))
        return self._arrived.popleft()


class HostileDAQ(MemoryDAQ):
    """The protocol's host behind it."""

    def __init__(self, wire: str, end: str, mode: str, chance: random.Random, counts: Counts) -> None:
        bench = bench_with()
        # A device that waits for its outputs does the same whatever is lost: its rows are those of a sound line.
        super().__init__(bench, SEED, WireOptions(queue_blocks=QUEUE), lockstep=mode == "damaged")
        self._link_of = lambda: _Link(self.wire, end, _Hostile(wire, end, mode, chance, counts, len(bench.channels)))

    def _make_link(self) -> Link:
        return self._link_of()


def hostile_bytes(wire: str, end: str, mode: str, n_bytes: int, seed: int) -> Counts:
    """Send at least so many hostile bytes to one end, in run after run, and look what comes of each."""
    chance, counts = random.Random(f"{wire} {end} {mode} {seed}"), Counts()
    right = virtual(BLOCK, QUEUE, SEED)
    memory_mb = 0.0
    while counts.n_bytes < n_bytes:
        daq = HostileDAQ(wire, end, mode, chance, counts)
        counts.runs += 1
        counts.ended[_run(daq, end, mode, right, counts)] += 1
        if counts.runs == 20:
            memory_mb = _memory_mb()
    counts.grown_mb = _memory_mb() - memory_mb if memory_mb else 0.0
    return counts


def _run(daq: HostileDAQ, end: str, mode: str, right: np.ndarray, counts: Counts) -> str:
    """One run; how it ended."""
    rows: list[np.ndarray] = []
    flags: list[np.ndarray] = []
    try:
        with daq:
            daq.start(BLOCK)
            for volts in voltages(BLOCK, BLOCKS):
                rows.append(daq.exchange(volts))
                flags.append(daq.flags.copy())
        how = "carried out"
    except DaqError as error:
        how = type(error).__name__
        if "\n" in str(error) or not str(error).isprintable():
            counts.wrong.append(f"an error that is no line: {error!r}")
    except Exception as error:  # whatever it is: it is what this looks for
        how = "unexpected"
        counts.wrong.append(f"{type(error).__name__}: {error}")
    _judge_rows(rows, flags, right if mode == "damaged" and end == "host" else None, counts)
    daq.wire.cut = True
    daq.wire.pass_time(ALIKE_S)
    if np.any(daq.device.output_v) or daq.device.state is DeviceState.ARMED:
        counts.wrong.append(f"the device is left {daq.device.state.name} at {daq.device.output_v} V")
    return how


def _judge_rows(rows: list[np.ndarray], flags: list[np.ndarray], right: np.ndarray | None, counts: Counts) -> None:
    """Rows are right, or gaps that are told; where frames were forged, only the gaps can be judged."""
    if not rows:
        return
    found, lost = np.vstack(rows), (np.concatenate(flags) & LOST).astype(bool)
    if not np.array_equal(np.isnan(found).all(axis=1), lost):
        counts.wrong.append("gaps that are not told, or told where there are none")
    if right is not None:
        counts.rows_wrong += int(np.count_nonzero((found[~lost] != right[: len(found)][~lost]).any(axis=1)))


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
