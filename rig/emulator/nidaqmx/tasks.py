"""Tasks of the emulated NI-DAQmx: what is configured, reserved and running."""

import itertools
from contextlib import suppress

from nidaqmx.constants import Coupling, DigitalWidthUnits, TaskMode
from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.buffers import Buffers
from rig.emulator.nidaqmx.devices import RANGE_MARGIN, Device, Inputs, coerced_hz
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.task import Task, Value, VirtualChannel, expanded, number
from rig.emulator.nidaqmx.timeline import Timeline
from rig.emulator.nidaqmx.watchdogs import Watchdogs

EXTERNAL_CLOCK = "PFI0"
"""Terminal of the multifunction devices that is connected to a clock at the rate that is asked for."""


class Tasks:
    """All tasks, and the devices that they use. Methods raise `NiError`; they are called with the timeline's lock held."""

    def __init__(self, devices: dict[str, Device], timeline: Timeline) -> None:
        self.devices, self.timeline = devices, timeline
        self.all: dict[str, Task] = {}
        self.buffers, self.watchdogs = Buffers(timeline, self), Watchdogs(timeline, self)
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
        asked = task.number("asked_hz")
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
            self.watchdogs.reserve(task)
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
        failed = {task.owner for task in self.all.values() if task.failure is not None or task.has_run_dry}
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
            self.watchdogs.start(task)
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
        failed = task.has_run_dry and task.failure is None
        if task.generation is not None:
            self.timeline.generation, task.generation = None, None
            self.timeline.note()
        if not any(other.running and other.first is not None for other in self.all.values()):
            self.timeline.end()
        self.timeline.lock.notify_all()
        if failed:
            raise task.underflow()

    def clear(self, task: Task) -> None:
        """Stop a task and forget it."""
        with suppress(NiError):
            self.stop(task)
        self.all.pop(task.name, None)

    def is_done(self, task: Task) -> bool:
        """Whether a task has ended."""
        self.timeline.advance()
        task.raise_failure()
        return not task.running

    def reset(self, device: str) -> None:
        """Reset a device: its tasks are cleared, its output is at 0 V."""
        if device not in self.devices:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {device!r}")
        timed_by = self.devices[device].timed_by
        for task in list(self.all.values()):
            if task.is_on(timed_by) or task.text("timed_by") == timed_by:
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
    asked = [number(channel.attributes, end) for end in ("MIN", "MAX")]
    if any(abs(value) > largest_v * RANGE_MARGIN for value in asked):
        raise NiError(
            DAQmxErrors.INVALID_ATTRIBUTE_VALUE,
            f"{channel.name} takes -{largest_v:g} V to {largest_v:g} V, asked for {asked}",
        )


def _share(first: Task, second: Task) -> bool:
    """Whether two tasks need the same part of a device."""
    return first.kind == second.kind and any(device in second.devices for device in first.devices)
