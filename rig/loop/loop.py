"""The loop: it passes blocks from the driver through the tick and back, and yields telemetry in chunks."""

import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from rig.daq import DAQ, Image
from rig.loop.driven_loop import DrivenLoop
from rig.text.json_values import JsonObject
from rig.tick.layout import TickArrays
from rig.tick.tick import Tick

CHUNK_S = 0.5  # of telemetry, where no clock paces the loop; chosen
PACED_CHUNK_S = 0.02  # of telemetry, where a clock paces it; chosen: a stop acts within it


@runtime_checkable
class FusedDAQ(Protocol):
    """A driver that can run the tick together with its rig in one compiled loop."""

    def run_fused(self, t: TickArrays, readings: np.ndarray, rows: np.ndarray) -> int:
        """Fill ``readings`` and ``rows``; return the number of samples done, fewer than requested if the output went off."""


@dataclass
class LoopStatistics:
    """Statistics of a loop. ``busy_s`` is the time spent in tick and driver."""

    sample_rate_hz: float
    samples: int = 0
    overruns: int = 0
    busy_s: float = 0.0
    wall_s: float = 0.0

    @property
    def realtime_factor(self) -> float:
        """Seconds of rig time per second spent in tick and driver."""
        return self.samples / self.sample_rate_hz / self.busy_s if self.busy_s > 0 else 0.0

    @property
    def end_to_end_factor(self) -> float:
        """Seconds of rig time per second in total, including recording."""
        return self.samples / self.sample_rate_hz / self.wall_s if self.wall_s > 0 else 0.0

    def report(self, periods: int) -> dict[str, float]:
        """Return the loop's statistics as plain data. ``periods``: number of oscillator periods in all."""
        factors = {"realtime_factor": self.realtime_factor, "end_to_end_factor": self.end_to_end_factor}
        return {**asdict(self), "periods": periods, **factors}


class Loop(DrivenLoop):
    """Runs a tick over a started driver until the guard has brought the output to 0 V.

    `run` yields structured rows in chunks; between two chunks the caller may `request_stop`. A driver that fails
    ends the loop: the rows so far are yielded, ``failure`` holds the error. An interruption inside the driver
    (`KeyboardInterrupt`, `SystemExit`) is raised by `run` once the output is off and all rows are yielded.

    ``paced`` slows a virtual rig to the wall clock; a chunk that is completed too late counts as an overrun. With
    ``fused = False`` a virtual rig uses `DAQ.exchange` like a real device.
    """

    def __init__(self, daq: DAQ, tick: Tick, *, paced: bool = False, fused: bool = True) -> None:
        super().__init__(daq, tick)
        self.paced = paced
        self.notes: tuple[str, ...] = ()
        self.chunk_s = PACED_CHUNK_S if paced or daq.capabilities.paced else CHUNK_S
        """Length of the chunks of telemetry, s; a request to stop acts where one ends."""
        self.statistics = LoopStatistics(daq.sample_rate_hz)
        self._fused = daq if fused and isinstance(daq, FusedDAQ) else None

    @property
    def waits(self) -> bool:
        """Whether the loop pauses while its rows are not taken: unless it is paced or its device has a clock."""
        return not (self.paced or self.daq.wall_clock)

    def run(self) -> Iterator[np.ndarray]:
        """Telemetry in chunks, until the output is off."""
        yield from self._chunks()
        if self.interruption is not None:
            raise self.interruption

    def bring_down(self) -> None:
        """Ramp to 0 V if the loop still runs; the rows are dropped."""
        self.request_stop()
        for _ in self._chunks():
            pass

    def _chunks(self) -> Iterator[np.ndarray]:
        self._load_kernels()
        began = time.perf_counter()
        while not self.over:
            readings, rows = self.tick.buffers(self._chunk_samples())
            start = time.perf_counter()
            done = self._advance(readings, rows)
            self.statistics.busy_s += time.perf_counter() - start
            self.statistics.samples += done
            if self.over:
                self.stop()  # before its rows are yielded: the caller may take long
            early_s = began + self.statistics.samples / self.daq.sample_rate_hz - time.perf_counter()
            if self.paced and early_s > 0.0:
                time.sleep(early_s)
            elif self.paced:
                self.statistics.overruns += 1
            self.statistics.wall_s = time.perf_counter() - began
            if done:
                yield self.tick.joined(readings[:done], rows[:done])
        self.statistics.wall_s = time.perf_counter() - began

    def request_stop(self, cause: str = "") -> None:
        """Request the ramp to 0 V, which begins with the next chunk; an optional ``cause`` is recorded.

        Returns at once; may be called at any time and from a signal handler.
        """
        self.cause = self.cause or cause
        self.tick.request_stop()

    def release_start(self) -> None:
        """Let the start segment of a tick with ``start_judged`` end at its time. Any thread may call it."""
        self.tick.release_start()

    def continue_start(self, judgements: int) -> None:
        """Do nothing: this loop goes on by itself."""

    @property
    def lateness_us(self) -> tuple[float, float, float, float]:
        """Response times so far, us: p50, p99, p99.9 and the largest; NaN, for this loop counts late chunks alone."""
        return (math.nan,) * 4

    @property
    def images(self) -> tuple[Image, ...]:
        """Images of the held output in the force reading, as the driver knows them."""
        return self.daq.images

    @property
    def remarks(self) -> tuple[str, ...]:
        """The driver's remarks on the bench."""
        return (*self.daq.remarks, *self.notes)

    @property
    def report(self) -> JsonObject:
        """Timing statistics of the loop as plain data, for the recording."""
        return {**self.statistics.report(int(self.tick.arrays.loop["cycles"][0])), **self.daq.statistics}

    def _load_kernels(self) -> None:
        readings, rows = self.tick.buffers(0)
        if self._fused is not None:
            self._fused.run_fused(self.tick.arrays, readings, rows)
        else:
            self._tick_block = self._bound_tick(readings, rows)

    @property
    def over(self) -> bool:
        """Whether the output is off for good."""
        return self.failure is not None or self.tick.over

    def _chunk_samples(self) -> int:
        """Return the size of the next chunk: up to the end of the present ``chunk_s``.

        A start that is judged comes in chunks of a period, up to the block in which a judgement is due: it lasts no longer than
        that needs.
        """
        block = self.daq.block
        whole = max(1, round(self.chunk_s * self.daq.sample_rate_hz / block))
        blocks = whole - self.statistics.samples // block % whole
        if self.tick.start_held:
            period = self.daq.sample_rate_hz / self.tick.frequency_hz / block
            blocks = min(blocks, max(1, math.floor(period * min(1.0, self.tick.periods_to_judgement)) - 1))
        return blocks * block

    def _advance(self, readings: np.ndarray, rows: np.ndarray) -> int:
        if self._fused is not None:
            return self._fused.run_fused(self.tick.arrays, readings, rows)
        block, tick_block = self.daq.block, self._tick_block
        told = self.daq.put_out, self.daq.continuation
        for first in range(0, rows.size, block):
            swapped = self._swap()
            if swapped is None:
                return first
            part = slice(first, first + block)
            tick_block(self.tick.arrays, *swapped, readings[part], rows[part], self._voltages, *told)
            if self.over:
                return first + block
        return int(rows.size)
