"""The memory that the loop process and the campaign share: control words, histograms and a ring of chunks.

The memory has no name in the file system, only descriptors in two processes, so that nothing remains if a process is killed.
Each side writes different words. A completed chunk is announced by a message through a pipe, which also orders the memory
accesses.
"""

import math
import mmap
import os
import tempfile
from dataclasses import dataclass

import numpy as np

from rig.bench import Bench
from rig.loop.worker.histogram import WORDS, Histogram
from rig.tick.layout import ROW, TickArrays

CHUNK_S = 0.02  # of telemetry that is handed over at a time; chosen
ALIGNMENT = 64  # bytes: a cache line
STOP, TAKEN, PUBLISHED, RELEASE_START, START_JUDGED = range(5)  # places of the control words
CONTROL_WORDS = 8  # of eight bytes before the histograms; five are used
TIMES = ("wake_up", "execution", "response")
"""Times counted for every block: delay of the block's start, duration, and the sum of both."""
CONSTANTS = 7  # of the fields of `TickArrays`, the first are constants of the run
SNAPSHOT = tuple(name for name in TickArrays._fields[CONSTANTS:] if name != "history")
HEAD = ("rows", "samples", "overruns", "busy_ns", "wall_ns")


def anonymous_file() -> int:
    """Return the descriptor of an empty nameless file in memory or, where not supported, of a file already removed."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("vibrolock-loop")
    descriptor, path = tempfile.mkstemp(prefix="vibrolock-")
    os.unlink(path)  # noqa: PTH108
    return descriptor


def _aligned(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT


def packed(arrays: TickArrays) -> tuple[TickArrays, np.ndarray]:
    """Return the arrays with their state moved to one block of memory, and this block (uint8): a snapshot is one copy."""
    sizes = [_aligned(getattr(arrays, name).nbytes) for name in SNAPSHOT]
    memory = np.zeros(sum(sizes) + ALIGNMENT, np.uint8)
    memory = memory[-memory.ctypes.data % ALIGNMENT :][: sum(sizes)]
    moved: dict[str, np.ndarray] = {}
    first = 0
    for name, size in zip(SNAPSHOT, sizes, strict=True):
        old = getattr(arrays, name)
        moved[name] = memory[first : first + old.nbytes].view(old.dtype).reshape(old.shape)
        moved[name][...] = old
        first += size
    return arrays._replace(**moved), memory


def chunk_of(bench: Bench) -> int:
    """Return the samples of a chunk of the ring: about 20 ms, whole blocks of the bench."""
    return max(1, round(CHUNK_S * bench.sample_rate_hz / bench.block)) * bench.block


@dataclass(frozen=True)
class Layout:
    """Layout of the shared memory; both sides compute it from the same numbers."""

    chunk: int
    """Samples of a chunk: about 20 ms or a multiple, whole blocks."""
    slots: int
    """Chunks of the ring."""
    reserve: int
    """Chunks that a ramp to 0 V takes. When only these are free, the ramp begins, so that no row is lost."""
    n_channels: int
    n_counters: int
    state_bytes: int

    @classmethod
    def of(cls, bench: Bench, arrays: TickArrays, n_counters: int, ring_s: float, times: int = 1) -> "Layout":
        """Return the layout for a bench and its tick's arrays; a campaign may be late by ``ring_s`` before a ramp begins.

        ``times``: how many times the usual chunk one has.
        """
        chunk = times * chunk_of(bench)
        chunk_s = chunk / bench.sample_rate_hz
        lead = int(arrays.loop["delay_whole"][0])
        reserve = math.ceil((bench.limits.ramp_down_s + lead / bench.sample_rate_hz) / chunk_s) + 4
        state = sum(_aligned(getattr(arrays, name).nbytes) for name in SNAPSHOT)
        slots = math.ceil(ring_s / chunk_s) + reserve
        return cls(chunk, slots, reserve, len(bench.channels), n_counters, state)

    @property
    def slot_bytes(self) -> int:
        """Bytes of a slot of the ring."""
        return sum(_aligned(size) for size in self._parts)

    @property
    def _parts(self) -> tuple[int, ...]:
        head = 8 * (len(HEAD) + self.n_counters)
        return head, self.state_bytes, 4 * self.chunk * self.n_channels, self.chunk * ROW.itemsize

    @property
    def first_slot(self) -> int:
        """Offset of the ring, in bytes."""
        return _aligned(8 * (CONTROL_WORDS + len(TIMES) * WORDS))

    @property
    def size(self) -> int:
        """Bytes of the whole block."""
        return self.first_slot + self.slots * self.slot_bytes


class Slot:
    """A slot of the ring as arrays: a chunk of telemetry, and the state as of its last row."""

    def __init__(self, memory: np.ndarray, layout: Layout) -> None:
        ends = np.cumsum([_aligned(size) for size in layout._parts])
        head, state, readings, rows = (
            memory[end - _aligned(size) : end][:size] for end, size in zip(ends, layout._parts, strict=True)
        )
        numbers = head.view(np.int64)
        self.head = numbers[: len(HEAD)]
        """Rows filled; samples, overruns, nanoseconds busy and in all, since the beginning of the loop."""
        self.counters = numbers[len(HEAD) :]
        """The driver's counters."""
        self.state = state
        """State of the tick, as packed by `packed`."""
        self.readings = readings.view(np.float32).reshape(layout.chunk, layout.n_channels)
        self.rows = rows.view(ROW)


class SharedMemory:
    """The shared block of memory, for either side."""

    def __init__(self, descriptor: int, layout: Layout, *, create: bool = False) -> None:
        if create:
            os.ftruncate(descriptor, layout.size)
        self.layout = layout
        self._map = mmap.mmap(descriptor, layout.size)
        memory = np.frombuffer(self._map, np.uint8)
        if create:
            memory[:] = 0  # touch every page before the clock runs
        self.words = memoryview(self._map)[: 8 * (CONTROL_WORDS + len(TIMES) * WORDS)].cast("q")
        """Control words and histograms."""
        self.histograms = {
            name: Histogram(self.words[CONTROL_WORDS + index * WORDS : CONTROL_WORDS + (index + 1) * WORDS])
            for index, name in enumerate(TIMES)
        }
        first, size = layout.first_slot, layout.slot_bytes
        self._slots = [Slot(memory[first + k * size : first + (k + 1) * size], layout) for k in range(layout.slots)]

    @property
    def published(self) -> int:
        """Chunks that the loop has completed."""
        return self.words[PUBLISHED]

    @property
    def free(self) -> int:
        """Slots that the loop may still fill."""
        return self.layout.slots - (self.words[PUBLISHED] - self.words[TAKEN])

    def to_fill(self) -> Slot:
        """The next slot that the loop fills."""
        return self._slots[self.words[PUBLISHED] % self.layout.slots]

    def publish(self) -> None:
        """Mark the slot `to_fill` as complete."""
        self.words[PUBLISHED] += 1

    def to_take(self) -> Slot:
        """The next slot that the campaign takes."""
        return self._slots[self.words[TAKEN] % self.layout.slots]
