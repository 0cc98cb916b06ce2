"""Reading and writing of the emulated NI-DAQmx: calls that wait for samples, or for room."""

import math
from typing import Protocol

import numpy as np
from nidaqmx.constants import RegenerationMode
from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.devices import RANGE_MARGIN
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.generation import Generation
from rig.emulator.nidaqmx.task import Task
from rig.emulator.nidaqmx.timeline import Timeline
from vibrolock.arrays import Float

AUTOMATIC_BUFFERS = ((100.0, 1000), (10_000.0, 10_000), (1e6, 100_000), (math.inf, 1_000_000))
"""Input buffer that NI-DAQmx chooses for a continuous task, samples, up to each rate, Hz (NI-DAQmx help, "How is buffer size
determined")."""


class States(Protocol):
    """What brings a task into a state; see `rig.emulator.nidaqmx.tasks.Tasks`."""

    def verify(self, task: Task) -> None:
        """Check its configuration."""

    def reserve(self, task: Task) -> None:
        """Take its devices."""

    def start(self, task: Task) -> None:
        """Start it."""


class Buffers:
    """Reads and writes for tasks. Methods raise `NiError`; they are called with the timeline's lock held."""

    def __init__(self, timeline: Timeline, states: States) -> None:
        self._timeline, self._states = timeline, states

    def read(self, task: Task, n: int, timeout_s: float) -> tuple[Float, DAQmxErrors | None]:
        """Read n samples [channels, n]; fewer, with an error, where they have not come in time. -1: all that are there."""
        timeline = self._timeline
        if task.kind != "ai":
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} does not read")
        if not task.running:
            self._states.start(task)
        until_s = timeline.clock() + timeout_s if timeout_s >= 0.0 else math.inf
        buffer = input_buffer(task)
        while True:
            task.raise_failure()
            if not task.running:
                raise NiError(DAQmxErrors.SAMPLES_WILL_NEVER_BE_AVAILABLE, f"{task.name} has been stopped", read=0)
            first = task.first
            available = 0
            if first is not None:
                timeline.advance()
                if n > 0:
                    timeline.advance_freely(first + task.position + n)
                available = timeline.done - first - task.position
            if available > buffer:
                raise NiError(
                    DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE,
                    "samples have been overwritten before they were read",
                    read=0,
                )
            wanted = available if n < 0 else n
            if available >= wanted:
                return self._take(task, wanted), None
            now_s = timeline.clock()
            if now_s >= until_s:
                return self._take(task, available), DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE
            wake_s = until_s
            if first is not None and not timeline.lockstep:
                wake_s = min(until_s, timeline.due_s(first + task.position + wanted - 1))
            timeline.lock.wait(min(max(wake_s - now_s, 0.0), 3600.0))

    def _take(self, task: Task, n: int) -> Float:
        columns = [channel.column for channel in task.channels]
        rows = self._timeline.readings((task.first or 0) + task.position, n, columns)
        task.position += n
        return rows

    def write(self, task: Task, volts: Float, timeout_s: float, *, auto_start: bool) -> int:
        """Write samples [n], V; waits for room. Returns how many were written."""
        timeline = self._timeline
        if task.kind != "ao":
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} does not write")
        _check_volts(task, volts)
        if not task.is_timed:
            return self._write_at_once(task, volts, auto_start=auto_start)
        self._states.verify(task)
        if task.generation is None:
            regenerates = task.attributes.get("REGEN_MODE") != RegenerationMode.DONT_ALLOW_REGENERATION.value
            size = int(task.number("OUTPUT_BUF_SIZE", volts.size))
            task.generation = Generation(size, regenerates=regenerates)
        until_s = timeline.clock() + timeout_s if timeout_s >= 0.0 else math.inf
        while True:
            generation = task.generation
            if generation is None:
                raise NiError(DAQmxErrors.SAMPLES_WILL_NEVER_BE_GENERATED, f"{task.name} has been stopped", written=0)
            present = timeline.present() if timeline.on else 0
            if timeline.on and generation.runs_dry(present):
                timeline.advance()
            task.raise_failure(written=0)
            if generation.room(present) >= volts.size:
                break
            now_s = timeline.clock()
            if now_s >= until_s or not task.running:
                raise NiError(
                    DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN, f"the buffer of {generation.size} is full", written=0
                )
            wake_s = until_s
            if generation.first is not None and not timeline.lockstep:
                wake_s = min(
                    until_s, timeline.due_s(generation.first + generation.written + volts.size - generation.size)
                )
            timeline.lock.wait(max(0.0, min(wake_s - now_s, 3600.0)))
        generation.write(volts)
        if auto_start and not task.running:
            self._states.start(task)
        if timeline.lockstep:
            timeline.lock.notify_all()
        return int(volts.size)

    def _write_at_once(self, task: Task, volts: Float, *, auto_start: bool) -> int:
        self._states.reserve(task)
        if not (task.running or auto_start):
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} is not running, and auto_start is off")
        self._timeline.put_out(float(volts[-1]))
        return 1


def input_buffer(task: Task) -> int:
    """Samples a channel that the input buffer holds."""
    if "INPUT_BUF_SIZE" in task.attributes:
        return int(task.number("INPUT_BUF_SIZE"))
    automatic = next(size for rate_hz, size in AUTOMATIC_BUFFERS if task.rate_hz <= rate_hz)
    return max(automatic, int(task.number("SAMP_QUANT_SAMP_PER_CHAN")))


def _check_volts(task: Task, volts: Float) -> None:
    for channel in task.channels:
        group = channel.device.outputs
        largest = group.range_v if group is not None else 0.0
        if not np.all(np.abs(volts) <= largest * RANGE_MARGIN):
            largest_asked = float(np.max(np.abs(volts)))
            raise NiError(
                DAQmxErrors.INVALID_AO_DATA_WRITE,
                f"{largest_asked:g} V on {channel.name}: up to {largest:g} V",
                written=0,
            )
