"""Watchdog tasks of the emulated NI-DAQmx."""

import math
from typing import Protocol

from nidaqmx.constants import WDTTaskAction
from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.devices import Device
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.task import Task
from rig.emulator.nidaqmx.timeline import Timeline


class Others(Protocol):
    """The other tasks, and the devices; see `rig.emulator.nidaqmx.tasks.Tasks`."""

    devices: dict[str, Device]
    all: dict[str, Task]

    def create(self, name: str, owner: str, kind: str = "") -> Task:
        """Make a task."""


class Watchdogs:
    """The watchdogs of all devices. Methods raise `NiError`; they are called with the timeline's lock held."""

    def __init__(self, timeline: Timeline, tasks: Others) -> None:
        self._timeline, self._tasks = timeline, tasks

    def create(self, name: str, owner: str, device: str, timeout_s: float) -> Task:
        """Make the watchdog of a device, or of the chassis that it is in."""
        found = self._tasks.devices.get(device)
        if found is None:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {device!r}")
        if not self._tasks.devices[found.timed_by].watchdog:
            raise NiError(DAQmxErrors.WATCHDOG_TIMER_NOT_SUPPORTED, f"{device} has no watchdog")
        task = self._tasks.create(name, owner, "watchdog")
        task.attributes |= {"TIMEOUT": timeout_s, "AO_EXPIR_STATE": 0.0, "timed_by": found.timed_by}
        return task

    def control(self, task: Task, action: int) -> None:
        """Reset the timer of a watchdog, or clear its expiration."""
        if WDTTaskAction(action) is WDTTaskAction.CLEAR_EXPIRATION:
            task.failure = None
        elif task.failure is not None:
            raise task.failure
        if task.running:
            task.expires_s = self._timeline.clock() + task.number("TIMEOUT")

    def reserve(self, task: Task) -> None:
        """Take the watchdog of a chassis on which nothing else is reserved."""
        chassis = task.text("timed_by")
        if not task.reserved and any(other.reserved and other.is_on(chassis) for other in self._tasks.all.values()):
            raise NiError(DAQmxErrors.CANT_RESERVE_WATCHDOG_TASK_WHILE_OTHER_TASKS_RESERVED, f"{chassis} is reserved")
        task.reserved = True

    def start(self, task: Task) -> None:
        """Start a watchdog; nothing else may run on its chassis (cDAQ-9185/9189 user manual, "Watchdog Timer")."""
        self.reserve(task)
        chassis = task.text("timed_by")
        if any(other.running and other.is_on(chassis) for other in self._tasks.all.values()):
            raise NiError(DAQmxErrors.CANT_RESERVE_WATCHDOG_TASK_WHILE_OTHER_TASKS_RESERVED, f"tasks run on {chassis}")
        task.running = True
        self.control(task, WDTTaskAction.RESET_TIMER.value)

    def expire(self) -> None:
        """Let the watchdogs expire whose time is over: the outputs go to their state, and the tasks end."""
        if self._timeline.lockstep:
            return
        for watchdog in self._tasks.all.values():
            if watchdog.kind == "watchdog" and watchdog.running and self._timeline.clock() > watchdog.expires_s:
                timed_by = watchdog.text("timed_by")
                expired = NiError(DAQmxErrors.CHASSIS_WATCHDOG_TIMER_EXPIRED, f"the watchdog of {timed_by} has expired")
                watchdog.failure, watchdog.expires_s = expired, math.inf
                self._timeline.advance()
                for task in self._tasks.all.values():
                    if task.is_on(timed_by) and task.running:
                        task.failure = expired
                        if task.generation is not None:
                            task.generation.has_failed = True
                self._timeline.put_out(watchdog.number("AO_EXPIR_STATE"))
