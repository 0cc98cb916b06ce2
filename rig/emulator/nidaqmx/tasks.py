"""Tasks of the emulated NI-DAQmx: what is configured, reserved and running."""

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from nidaqmx.constants import (
    AcquisitionType,
    Coupling,
    DigitalWidthUnits,
    ExcitationSource,
    RegenerationMode,
    TaskMode,
    WDTTaskAction,
)
from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.devices import Device, Inputs, coerced_hz
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.generation import Generation
from rig.emulator.nidaqmx.timeline import Timeline
from vibrolock.arrays import Float

Value = bool | int | float | str | bytes | list[int] | list[float]
"""The value of an attribute."""
AUTOMATIC_BUFFERS = ((100.0, 1000), (10_000.0, 10_000), (1e6, 100_000), (math.inf, 1_000_000))
"""Input buffer that NI-DAQmx chooses for a continuous task, samples, up to each rate, Hz (NI-DAQmx help, "How is buffer size
determined")."""
RANGE_MARGIN = 1.0 + 1e-9
"""Rounding that a limit at the end of a range may have."""
EXTERNAL_CLOCK = "PFI0"
"""Terminal of the multifunction devices that is connected to a clock at the rate that is asked for."""


@dataclass
class VirtualChannel:
    """A channel of a task."""

    name: str
    physical: str
    device: Device
    column: int
    """Column of the rig's readings."""
    attributes: dict[str, Value] = field(default_factory=dict)


@dataclass
class Task:
    """A task; one of kind ``ai`` reads, one of kind ``ao`` writes, one of kind ``watchdog`` does neither."""

    name: str
    owner: str
    """Connection of the client that has made it."""
    kind: str = ""
    channels: list[VirtualChannel] = field(default_factory=list)
    attributes: dict[str, Value] = field(default_factory=dict)
    reserved: bool = False
    committed: bool = False
    running: bool = False
    first: int | None = None
    """Sample of the timeline at which it begins; None: it waits for its trigger."""
    position: int = 0
    """Samples read so far."""
    generation: Generation | None = None
    failure: NiError | None = None
    expires_s: float = math.inf

    @property
    def is_timed(self) -> bool:
        """Whether it has a sample clock."""
        return "SAMP_CLK_RATE" in self.attributes

    @property
    def rate_hz(self) -> float:
        """Rate of its sample clock, Hz."""
        return float(self.attributes["SAMP_CLK_RATE"])  # type: ignore[arg-type]

    def text(self, name: str) -> str:
        """Return a text attribute, empty if it has not been set."""
        return str(self.attributes.get(name, ""))

    def chosen(self, names: str) -> list[VirtualChannel]:
        """Channels of a list of names with commas; all for an empty one."""
        return [channel for channel in self.channels if not names or channel.name in expanded(names)]

    @property
    def has_expired(self) -> bool:
        """Whether it is a watchdog that has expired."""
        return self.kind == "watchdog" and self.failure is not None

    @property
    def devices(self) -> list[Device]:
        """Devices of its channels, each once."""
        return list({channel.device.name: channel.device for channel in self.channels}.values())

    @property
    def inputs(self) -> list[Inputs]:
        """Inputs of its devices."""
        return [device.inputs for device in self.devices if device.inputs is not None]


class Tasks:
    """All tasks, and the devices that they use. Methods raise `NiError`; they are called with the timeline's lock held."""

    def __init__(self, devices: dict[str, Device], timeline: Timeline) -> None:
        self.devices, self.timeline = devices, timeline
        self.all: dict[str, Task] = {}
        self._numbers = itertools.count()

    # Making a task

    def create(self, name: str, owner: str, kind: str = "") -> Task:
        """Make a task, with a name of its own if none is given."""
        name = name or f"_unnamedTask<{next(self._numbers):X}>"
        if name in self.all:
            self._free_abandoned([self.all[name]], owner)
        if name in self.all:
            raise NiError(DAQmxErrors.DUPLICATE_TASK, f"a task is named {name!r} already")
        task = self.all[name] = Task(name, owner, kind)
        return task

    def find(self, name: str) -> Task:
        """The task of a name."""
        if name not in self.all:
            raise NiError(DAQmxErrors.INVALID_TASK, f"there is no task {name!r}")
        return self.all[name]

    def add(self, task: Task, kind: str, physical: str, attributes: dict[str, Value]) -> list[VirtualChannel]:
        """Add virtual channels for physical ones, a list with commas and ranges such as ``cDAQ1Mod1/ai0:3``."""
        if task.kind not in ("", kind):
            raise NiError(DAQmxErrors.MULTI_CHAN_TYPES_IN_TASK, f"{task.name} has {task.kind} channels")
        added = []
        for name in expanded(physical):
            device, column = self.physical(name, kind)
            added.append(VirtualChannel(name, name, device, column, dict(attributes)))
        task.kind = kind
        task.channels += added
        return added

    def physical(self, name: str, kind: str) -> tuple[Device, int]:
        """Device of a physical channel, and the column of the rig's readings that it is connected to."""
        device = self.devices.get(name.partition("/")[0])
        if device is None:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {name.partition('/')[0]!r}")
        if name not in device.channels(kind):
            raise NiError(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, f"{device.name} has no channel {name!r}")
        before = [
            other for other in self.devices.values() if other.timed_by == device.timed_by and other.slot < device.slot
        ]
        return device, sum(len(other.channels(kind)) for other in before) + device.channels(kind).index(name)

    # Its states

    def control(self, task: Task, action: int) -> None:
        """Bring a task into a state of `nidaqmx.constants.TaskMode`."""
        match TaskMode(action):
            case TaskMode.TASK_START:
                self.start(task)
            case TaskMode.TASK_STOP | TaskMode.TASK_ABORT:
                self.stop(task)
            case TaskMode.TASK_VERIFY:
                self.verify(task)
            case TaskMode.TASK_RESERVE:
                self.reserve(task)
            case TaskMode.TASK_COMMIT:
                self.commit(task)
            case TaskMode.TASK_UNRESERVE:
                task.reserved = task.committed = False

    def verify(self, task: Task) -> None:
        """Check the configuration, and coerce the rate."""
        if not task.channels:
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} has no channels")
        for channel in task.channels:
            _check_range(channel, task.kind)
        if task.is_timed:
            self._verify_timing(task)

    def _verify_timing(self, task: Task) -> None:
        source = task.text("SAMP_CLK_SRC")
        self._check_terminal(source, task)
        self._check_terminal(task.text("DIG_EDGE_START_TRIG_SRC"), task)
        supplied = self._supplied_hz(source)
        asked = float(task.attributes["asked_hz"])  # type: ignore[arg-type]
        if supplied is not None:
            task.attributes["SAMP_CLK_RATE"] = supplied
            return
        highest = min(
            [group.highest_hz for group in task.inputs]
            + [device.outputs.highest_hz for device in task.devices if device.outputs and task.kind == "ao"]
        )
        lowest = max([group.lowest_hz for group in task.inputs], default=0.0)
        if not lowest * (1 - 1e-9) <= asked <= highest * (1 + 1e-9):
            raise NiError(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"SampClk.Rate {asked:g}: {lowest:g} to {highest:g} Hz")
        task.attributes["SAMP_CLK_RATE"] = coerced_hz(task.inputs, asked)

    def _supplied_hz(self, source: str) -> float | None:
        """Rate of the clock of another task, if that is the source."""
        for other in self.all.values():
            if other.kind and source in {f"/{device.timed_by}/{other.kind}/SampleClock" for device in other.devices}:
                return other.rate_hz if other.is_timed else None
        return None

    def _check_terminal(self, source: str, task: Task) -> None:
        if source in ("", "OnboardClock"):
            return
        path = source if source.startswith("/") else f"/{task.devices[0].timed_by}/{source}"
        if not any(path in device.terminals for device in self.devices.values()):
            raise NiError(DAQmxErrors.INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING, f"there is no terminal {source!r}")
        if "PFI" in path and any(group.is_delta_sigma for group in task.inputs):
            raise NiError(
                DAQmxErrors.ROUTE_NOT_SUPPORTED_BY_HW_ROUTING, f"a delta-sigma module is not clocked by {source!r}"
            )

    def reserve(self, task: Task) -> None:
        """Take the devices for a task; another task that has them keeps them."""
        if task.kind == "watchdog":
            self._reserve_watchdog(task)
            return
        self.verify(task)
        if task.reserved:
            return
        holders = [other for other in self.all.values() if other is not task and other.reserved and _share(other, task)]
        holders = self._free_abandoned(holders, task.owner)
        if holders:
            raise NiError(
                DAQmxErrors.PAL_RESOURCE_RESERVED, f"{task.devices[0].name} is reserved by task {holders[0].name}"
            )
        task.reserved = True

    def _free_abandoned(self, holders: list[Task], owner: str) -> list[Task]:
        """Clear tasks of a client that has gone, as NI's driver does at the end of a process; return those that remain."""
        failed = {task.owner for task in self.all.values() if task.failure is not None or _has_failed(task)}
        for task in [other for other in holders if other.owner != owner and other.owner in failed]:
            for abandoned in [other for other in self.all.values() if other.owner == task.owner]:
                self.clear(abandoned)
        return [task for task in holders if task.name in self.all]

    def commit(self, task: Task) -> None:
        """Program the devices."""
        self.reserve(task)
        if task.kind == "ai" and task.is_timed and not task.committed and not self.timeline.on:
            ac = [c.column for c in task.channels if c.attributes.get("AI_COUPLING") == Coupling.AC.value]
            self.timeline.prepare(task.rate_hz, task.inputs[0], tuple(ac))
        task.committed = True

    def start(self, task: Task) -> None:
        """Start a task, or arm it on the start of another one."""
        if task.running:
            return
        if task.kind == "watchdog":
            self._start_watchdog(task)
            return
        self.commit(task)
        task.running, task.failure, task.position, task.first = True, None, 0, None
        if not task.is_timed:
            return
        if task.kind == "ao":
            if task.generation is None or not task.generation.written:
                task.running = False
                raise NiError(DAQmxErrors.OUTPUT_BUFFER_EMPTY, f"nothing has been written to task {task.name}")
            self.timeline.generation = task.generation
        if self._waits(task):
            return
        self._begin(task)

    def _waits(self, task: Task) -> bool:
        """Whether a task that is started waits for a clock or trigger that is not there."""
        for source in (task.text("SAMP_CLK_SRC"), task.text("DIG_EDGE_START_TRIG_SRC")):
            end = source.rpartition("/")[2]
            if end.startswith("PFI") and end != EXTERNAL_CLOCK:
                return True
            if source.endswith(("ai/SampleClock", "ai/StartTrigger")) and task.kind != "ai":
                return not any(other.kind == "ai" and other.first is not None for other in self.all.values())
        return False

    def _begin(self, task: Task) -> None:
        timeline = self.timeline
        if not timeline.on:
            if task.rate_hz != timeline.rate_hz:
                timeline.prepare(task.rate_hz, task.inputs[0] if task.inputs else Inputs(1, (10.0,), 16, 0.0, 1e6))
            timeline.begin()
        else:
            timeline.advance()
        self._from(task, timeline.done)
        if task.kind == "ai":
            for other in self.all.values():
                if other.running and other.first is None and not self._waits(other):
                    self._from(other, timeline.done)

    def _from(self, task: Task, first: int) -> None:
        task.first = first
        if task.generation is not None:
            task.generation.first = first

    def stop(self, task: Task) -> None:
        """Stop a task; the output stays where it is."""
        if not task.running:
            return
        self.timeline.advance()
        task.running, task.first = False, None
        failed = _has_failed(task) and task.failure is None
        if task.generation is not None:
            self.timeline.generation, task.generation = None, None
            self.timeline.note()
        if not any(other.running and other.first is not None for other in self.all.values()):
            self.timeline.end()
        self.timeline.lock.notify_all()
        if failed:
            raise _underflow(task)

    def clear(self, task: Task) -> None:
        """Stop a task and forget it."""
        with suppress(NiError):
            self.stop(task)
        self.all.pop(task.name, None)

    # Data

    def read(self, task: Task, n: int, timeout_s: float) -> tuple[Float, DAQmxErrors | None]:
        """Read n samples [channels, n]; fewer, with an error, where they have not come in time. -1: all that are there."""
        timeline = self.timeline
        if task.kind != "ai":
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} does not read")
        if not task.running:
            self.start(task)
        until_s = timeline.clock() + timeout_s if timeout_s >= 0.0 else math.inf
        buffer = self.input_buffer(task)
        while True:
            self._raise_failure(task)
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
        rows = self.timeline.readings((task.first or 0) + task.position, n, columns)
        task.position += n
        return rows

    def input_buffer(self, task: Task) -> int:
        """Samples a channel that the input buffer holds."""
        if "INPUT_BUF_SIZE" in task.attributes:
            return int(task.attributes["INPUT_BUF_SIZE"])  # type: ignore[arg-type]
        automatic = next(size for rate_hz, size in AUTOMATIC_BUFFERS if task.rate_hz <= rate_hz)
        return max(automatic, int(task.attributes.get("SAMP_QUANT_SAMP_PER_CHAN", 0)))  # type: ignore[arg-type]

    def write(self, task: Task, volts: Float, timeout_s: float, *, auto_start: bool) -> int:
        """Write samples [n], V; waits for room. Returns how many were written."""
        timeline = self.timeline
        if task.kind != "ao":
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} does not write")
        self._check_volts(task, volts)
        if not task.is_timed:
            return self._write_at_once(task, volts, auto_start=auto_start)
        self.verify(task)
        if task.generation is None:
            regenerates = task.attributes.get("REGEN_MODE") != RegenerationMode.DONT_ALLOW_REGENERATION.value
            size = int(task.attributes.get("OUTPUT_BUF_SIZE", volts.size))  # type: ignore[arg-type]
            task.generation = Generation(size, regenerates=regenerates)
        until_s = timeline.clock() + timeout_s if timeout_s >= 0.0 else math.inf
        while True:
            generation = task.generation
            if generation is None:
                raise NiError(DAQmxErrors.SAMPLES_WILL_NEVER_BE_GENERATED, f"{task.name} has been stopped", written=0)
            present = timeline.present() if timeline.on else 0
            if timeline.on and generation.runs_dry(present):
                timeline.advance()
            self._raise_failure(task, written=0)
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
            self.start(task)
        if timeline.lockstep:
            timeline.lock.notify_all()
        return int(volts.size)

    def _write_at_once(self, task: Task, volts: Float, *, auto_start: bool) -> int:
        self.reserve(task)
        if not (task.running or auto_start):
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} is not running, and auto_start is off")
        self.timeline.put_out(float(volts[-1]))
        return 1

    def _check_volts(self, task: Task, volts: Float) -> None:
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

    def _raise_failure(self, task: Task, written: int | None = None) -> None:
        """Raise what has ended a task, if something has."""
        if task.failure is None and _has_failed(task):
            task.failure = _underflow(task)
        if task.failure is not None:
            raise NiError(task.failure.code, task.failure.reason, written=written)

    def is_done(self, task: Task) -> bool:
        """Whether a task has ended."""
        self.timeline.advance()
        self._raise_failure(task)
        return not task.running

    # Watchdogs

    def create_watchdog(self, name: str, owner: str, device: str, timeout_s: float) -> Task:
        """Make the watchdog of a device, or of the chassis that it is in."""
        found = self.devices.get(device)
        if found is None:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {device!r}")
        if not self.devices[found.timed_by].watchdog:
            raise NiError(DAQmxErrors.WATCHDOG_TIMER_NOT_SUPPORTED, f"{device} has no watchdog")
        task = self.create(name, owner, "watchdog")
        task.attributes |= {"TIMEOUT": timeout_s, "AO_EXPIR_STATE": 0.0, "timed_by": found.timed_by}
        return task

    def control_watchdog(self, task: Task, action: int) -> None:
        """Reset the timer of a watchdog, or clear its expiration."""
        if WDTTaskAction(action) is WDTTaskAction.CLEAR_EXPIRATION:
            task.failure = None
        elif task.failure is not None:
            raise task.failure
        if task.running:
            task.expires_s = self.timeline.clock() + float(task.attributes["TIMEOUT"])  # type: ignore[arg-type]

    def _reserve_watchdog(self, task: Task) -> None:
        chassis = task.text("timed_by")
        if not task.reserved and any(other.reserved and self._is_on(other, chassis) for other in self.all.values()):
            raise NiError(DAQmxErrors.CANT_RESERVE_WATCHDOG_TASK_WHILE_OTHER_TASKS_RESERVED, f"{chassis} is reserved")
        task.reserved = True

    def _start_watchdog(self, task: Task) -> None:
        """Start a watchdog; nothing else may run on its chassis (cDAQ-9185/9189 user manual, "Watchdog Timer")."""
        self._reserve_watchdog(task)
        chassis = task.text("timed_by")
        if any(other.running and self._is_on(other, chassis) for other in self.all.values()):
            raise NiError(DAQmxErrors.CANT_RESERVE_WATCHDOG_TASK_WHILE_OTHER_TASKS_RESERVED, f"tasks run on {chassis}")
        task.running = True
        self.control_watchdog(task, WDTTaskAction.RESET_TIMER.value)

    def _is_on(self, task: Task, timed_by: str) -> bool:
        return any(device.timed_by == timed_by for device in task.devices)

    def expire(self) -> None:
        """Let the watchdogs expire whose time is over: the outputs go to their state, and the tasks end."""
        if self.timeline.lockstep:
            return
        for watchdog in self.all.values():
            if watchdog.kind == "watchdog" and watchdog.running and self.timeline.clock() > watchdog.expires_s:
                timed_by = watchdog.text("timed_by")
                expired = NiError(DAQmxErrors.CHASSIS_WATCHDOG_TIMER_EXPIRED, f"the watchdog of {timed_by} has expired")
                watchdog.failure, watchdog.expires_s = expired, math.inf
                self.timeline.advance()
                for task in self.all.values():
                    if self._is_on(task, timed_by) and task.running:
                        task.failure = expired
                        if task.generation is not None:
                            task.generation.has_failed = True
                self.timeline.put_out(float(watchdog.attributes["AO_EXPIR_STATE"]))  # type: ignore[arg-type]

    def reset(self, device: str) -> None:
        """Reset a device: its tasks are cleared, its output is at 0 V."""
        if device not in self.devices:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {device!r}")
        timed_by = self.devices[device].timed_by
        for task in list(self.all.values()):
            if self._is_on(task, timed_by) or task.text("timed_by") == timed_by:
                self.clear(task)
        self.timeline.put_out(0.0)

    # Facts

    def filter_delay(self, task: Task, channel: VirtualChannel) -> float:
        """Delay of an input, in its own units: s, or samples."""
        inputs = channel.device.inputs
        if inputs is None or not task.is_timed:
            return 0.0
        samples = inputs.delay_samples + inputs.delay_s * task.rate_hz
        units = channel.attributes.get("AI_FILTER_DELAY_UNITS", DigitalWidthUnits.SECONDS.value)
        return samples if units == DigitalWidthUnits.SAMPLE_CLOCK_PERIODS.value else samples / task.rate_hz


def _check_range(channel: VirtualChannel, kind: str) -> None:
    inputs, outputs = channel.device.inputs, channel.device.outputs
    largest_v = (
        inputs.ranges_v[-1] if kind == "ai" and inputs is not None else outputs.range_v if outputs is not None else 0.0
    )
    asked = [float(channel.attributes.get(end, 0.0)) for end in ("MIN", "MAX")]  # type: ignore[arg-type]
    if any(abs(value) > largest_v * RANGE_MARGIN for value in asked):
        raise NiError(
            DAQmxErrors.INVALID_ATTRIBUTE_VALUE,
            f"{channel.name} takes -{largest_v:g} V to {largest_v:g} V, asked for {asked}",
        )


def _has_failed(task: Task) -> bool:
    return task.generation is not None and task.generation.has_failed


def _underflow(task: Task) -> NiError:
    return NiError(
        DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES,
        f"{task.name} has run out of samples that were written in time",
    )


def _share(first: Task, second: Task) -> bool:
    """Whether two tasks need the same part of a device."""
    return first.kind == second.kind and any(device in second.devices for device in first.devices)


def expanded(text: str) -> list[str]:
    """Names of a list with commas, in which ``Dev1/ai0:3`` or ``Dev1/ai0:Dev1/ai3`` is a range."""
    names: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        begin, _, end = part.partition(":")
        stem = begin.rstrip("0123456789")
        if not end:
            names.append(part)
            continue
        low, high = int(begin[len(stem) :]), int(end.rpartition("/")[2].lstrip("ao").lstrip("i") or 0)
        names += [f"{stem}{index}" for index in range(low, high + 1)]
    return names


DEFAULTS: dict[str, Value] = {
    "SAMP_QUANT_SAMP_MODE": AcquisitionType.FINITE.value,
    "REGEN_MODE": RegenerationMode.ALLOW_REGENERATION.value,
    "AI_COUPLING": Coupling.DC.value,
    "AI_EXCIT_SRC": ExcitationSource.NONE.value,
    "AI_EXCIT_VAL": 0.0,
    "AI_FILTER_DELAY_UNITS": DigitalWidthUnits.SECONDS.value,
}
"""Attributes that have not been set."""
