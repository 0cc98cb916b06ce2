"""The campaign's side of a bench whose driver and loop run in another process."""

import math
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import TracebackType
from typing import Self

import numpy as np

from rig.bench import Bench
from rig.daq import Capabilities, Image
from rig.errors import DaqError
from rig.loop.driven_loop import end_by_driver
from rig.loop.loop import LoopStatistics
from rig.loop.worker.loop import CHUNK_DONE
from rig.loop.worker.memory import RELEASE_START, START_JUDGED, STOP, TAKEN, TIMES, Layout, SharedMemory, packed
from rig.loop.worker.queue_choice import QueueChoice
from rig.loop.worker.spawn import WITHOUT_HOST, Worker, rebuilt
from rig.text.json_values import JsonObject
from rig.tick.tick import Tick, TickSettings

RING_S = 10.0  # of rows that wait for a late campaign; chosen
LONGEST_SILENCE_S = 10.0  # until a loop process counts as hanging; chosen
LOCKSTEP_SILENCE_S = 60.0  # the same in lockstep, where nothing is late however busy the computer is; chosen
HUNG_S = 0.5  # beyond the ramp until a hanging process is killed; chosen
TIMEOUT_S = 5.0  # beyond the ramp for a process to end; chosen


class WorkerLoop:
    """A loop in another process: its rows, and a copy of its state at the last row."""

    failure: DaqError | None

    def __init__(
        self,
        worker: Worker,
        settings: TickSettings,
        delay_samples: float,
        layout: Layout,
        counters: dict[str, int],
        remarks: tuple[str, ...],
        images: tuple[Image, ...],
        *,
        lockstep: bool = False,
    ) -> None:
        bench = settings.bench
        self.tick = Tick(settings, delay_samples)
        self.tick.arrays, self._state = packed(self.tick.arrays)
        self.failure = None
        self.cause = ""
        self.remarks, self.images = remarks, images
        self.counters = counters
        self.statistics = LoopStatistics(bench.sample_rate_hz)
        self.ended = False
        self._worker, self._memory = worker, SharedMemory(worker.memory, layout)
        self._ramp_down_s = bench.limits.ramp_down_s
        self._silence_s = max(
            LOCKSTEP_SILENCE_S if lockstep else LONGEST_SILENCE_S, 50 * bench.block / bench.sample_rate_hz
        )
        self._said: JsonObject = {}

    def run(self) -> Iterator[np.ndarray]:
        """Telemetry in chunks of about 20 ms, until the output is off or the loop's process is gone."""
        while not self.ended:
            end = self._wait()
            # a complete chunk counts, also if its announcement was lost
            while self._memory.published > self._memory.words[TAKEN]:
                rows = self._take()
                if rows.size:
                    yield rows
            if end is not None:
                end()

    @property
    def waits(self) -> bool:
        """False, because the other process continues."""
        return False

    def request_stop(self, cause: str = "") -> None:
        """Request the ramp to 0 V; the loop checks the request at every block."""
        self.cause = self.cause or cause
        self._memory.words[STOP] = 1

    def release_start(self) -> None:
        """Let the start segment end at its time; the loop looks for it at every block."""
        self._memory.words[RELEASE_START] = 1

    def continue_start(self, judgements: int) -> None:
        """Let the start segment go on after so many judgements; a loop in lockstep waits for this or for its release."""
        self._memory.words[START_JUDGED] = judgements

    def bring_down(self) -> None:
        """Ramp to 0 V if the loop still runs, and wait for its end; the rows are dropped."""
        self.request_stop()
        for _ in self.run():
            pass

    @property
    def lateness_us(self) -> tuple[float, float, float, float]:
        """Response times so far, us: p50, p99, p99.9 and the largest."""
        told = self._memory.histograms["response"].report()
        return told["p50"], told["p99"], told["p99_9"], told["largest"]

    @property
    def report(self) -> JsonObject:
        """Statistics for the record: how late each block began, how long it took, and both together, us.

        A loop on the device has no such times here.
        """
        told: JsonObject = {**self.statistics.report(int(self.tick.arrays.loop["cycles"][0])), **self._said}
        histograms = self._memory.histograms
        if not histograms["execution"].count:
            return told
        times = {f"{name}_us": histograms[name].report() for name in TIMES}
        return {**told, **times, "histograms": {name: histograms[name].bins() for name in TIMES}}

    def _wait(self) -> Callable[[], None] | None:
        """Wait for a chunk; if the loop has ended instead, return the function to call after the last chunk."""
        facts = self._worker.facts
        try:
            if not facts.poll(self._silence_s):
                left = self._worker.end(HUNG_S + self._ramp_down_s)
                how = left or f"the loop's process was ended; {WITHOUT_HOST}"
                text = f"the loop's process has been silent for {self._silence_s:g} s: its driver hangs; {how}"
                return partial(self._end, DaqError(text))
            said = facts.recv_bytes()
        except (EOFError, OSError):
            return partial(self._end, self._worker.ended())
        return None if said == CHUNK_DONE else partial(self._finish, said)

    def _take(self) -> np.ndarray:
        slot = self._memory.to_take()
        count, samples, overruns, busy_ns, wall_ns = (int(number) for number in slot.head)
        rows = self.tick.joined(slot.readings[:count], slot.rows[:count])
        self._state[:] = slot.state
        self.counters = dict(zip(self.counters, (int(number) for number in slot.counters), strict=False))
        self._memory.words[TAKEN] += 1
        statistics = self.statistics
        statistics.samples, statistics.overruns = samples, overruns
        statistics.busy_s, statistics.wall_s = 1e-9 * busy_ns, 1e-9 * wall_ns
        return rows

    def _finish(self, said: bytes) -> None:
        name, *facts = pickle.loads(said)
        if name == "ended":
            failure, cause, self.counters, self._said = facts
            self.cause = self.cause or cause
        else:
            failure = facts[0]
        error = None if failure is None else rebuilt(*failure)
        self._end(error if error is None or isinstance(error, DaqError) else DaqError(str(error)))

    def _end(self, failure: DaqError | None) -> None:
        self.failure, self.ended = failure, True
        if failure is not None:
            end_by_driver(self.tick, failure)


class WorkerSession:
    """Context manager that opens the driver in a separate process and ends with the output at 0 V.

    With ``privileged = False`` the process runs without real-time scheduling and locked memory. ``ring_s``: seconds of rows
    that the loop keeps for a campaign that is late.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError` if the driver cannot be opened.
    """

    capabilities: Capabilities
    identity: dict[str, str]
    latched: str

    def __init__(self, bench: Bench, seed: int = 0, *, privileged: bool = True, ring_s: float = RING_S) -> None:
        self._bench, self._ring_s, self._settled = bench, ring_s, False
        self._loop: WorkerLoop | None = None
        self._worker = Worker()
        try:
            self._worker.send("open", bench, seed, privileged)
            opened = self._worker.receive("opened")
            self.capabilities, self.identity, self.latched, self.remarks, self._counters = opened
        except BaseException:
            self._worker.close(0.5)
            raise

    @property
    def pid(self) -> int:
        """Number of the loop's process."""
        return self._worker.pid

    def settle_queue(
        self,
        *,
        feedback: bool = True,
        delay_s: float = math.inf,
        sizes: Mapping[str, int] | None = None,
        may_change: bool = False,
    ) -> QueueChoice | None:
        """Settle the queue of the device in its process, see `rig.loop.session.LocalSession.settle_queue`."""
        self._worker.send("queue", {"feedback": feedback, "delay_s": delay_s}, dict(sizes or {}), may_change)
        choice: QueueChoice | None = self._worker.receive("queue")[0]
        self._settled = True
        if choice is not None:  # the loop is the computer's after all
            self.identity = {name: text for name, text in self.identity.items() if name != "loop"}
        return choice

    def start(self, settings: TickSettings) -> WorkerLoop:
        """Start the device and the loop, which runs from now on; its rows wait in the ring until they are taken."""
        if not self._settled:
            self.settle_queue()
        if not self.capabilities.repeatable:
            settings.build(0.0)  # loads kernels, which on a busy computer takes longer than the ring lasts
        self._worker.send("start", settings, self._ring_s)
        delay_samples, layout, remarks, images, self.identity = self._worker.receive("started")
        lockstep = self.capabilities.paced and self.capabilities.repeatable
        self._loop = WorkerLoop(
            self._worker, settings, delay_samples, layout, self._counters, remarks, images, lockstep=lockstep
        )
        return self._loop

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Ramp down if the loop still runs, and wait for its end."""
        timeout_s = TIMEOUT_S + self._bench.limits.ramp_down_s  # it may run although its answer was lost
        if self._loop is not None and not self._loop.ended:
            self._loop.request_stop()
        left = self._worker.close(timeout_s)
        if left:
            warnings.warn(left, RuntimeWarning, stacklevel=2)
