"""The emulator process: a virtual rig behind a wire, served at the pace of the clock until it is told to end."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rig.bench.configuration import Table
from rig.emulator.device import Device
from rig.emulator.faults import Faults
from rig.emulator.firmware import started
from rig.emulator.parameters import LARGEST_BLOCK, described
from rig.emulator.plant import LoggedPlant, Plant, VirtualPlant, Wiring
from rig.emulator.ports import device_end, driver_options_of, largest_block
from rig.emulator.settings import EmulatorSettings
from rig.system.privileges import prepare
from rig.wire.link import Link

PRIORITY = 60
"""Of SCHED_FIFO: below the wall-clock loop's, above the kernel's interrupt threads."""
MOST_AT_ONCE = 64
"""Most messages that are read after a late deadline; chosen: more than arrive in one stall."""


def keep_serving(device: Device, should_end: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> None:
    """Serve a host until ``should_end``, which is called at every message and ten times a second, returns true.

    Deadlines are absolute times of ``clock``. If this process notices a deadline late, messages that have arrived until then
    count as in time, because the host is not to blame. Raises `rig.errors.DaqDisconnected` when the link is gone for good.
    """
    receive, handle, advance = device.link.receive, device.handle, device.advance
    advance(clock())
    while not should_end():
        wake_s = device.wake_s
        message = receive(max(0.0, wake_s - clock()))
        now_s = clock()
        if message is not None:
            handle(message, min(now_s, wake_s))
            if now_s >= wake_s:
                for _ in range(MOST_AT_ONCE):
                    message = receive(0.0)
                    if message is None:
                        break
                    handle(message, wake_s)
                now_s = clock()
        advance(now_s)
    device.switch_off(clock())


def ask_for_priority() -> str:
    """Request real-time scheduling and locked memory, and turn off garbage collection; return the scheduling granted."""
    scheduling = prepare(priority=PRIORITY)["scheduling"]
    return scheduling if scheduling.startswith("SCHED") else "ordinary scheduling"


@dataclass
class Ready:
    """Facts on an emulator that can now be reached."""

    wire: str
    options: Table
    """Driver options of a bench that reaches it."""
    lockstep: bool
    scheduling: str
    largest_block: int
    """Largest number of samples in a block on this wire."""
    process: int = field(default_factory=os.getpid)


class _End:
    """Whether to end: after SIGTERM, SIGINT or SIGHUP, or when the parent process is gone."""

    def __init__(self, parent: int | None) -> None:
        self._parent = parent
        self._told = False
        for name in ("SIGTERM", "SIGINT", "SIGHUP"):
            if hasattr(signal, name):  # SIGHUP does not exist on every system
                signal.signal(getattr(signal, name), self._tell)

    def _tell(self, _number: int, _frame: object) -> None:
        self._told = True

    def __call__(self) -> bool:
        return self._told or (self._parent is not None and os.getppid() != self._parent)


def run_emulator(
    settings: EmulatorSettings, when_ready: Callable[[Ready], None], *, parent: int | None = None
) -> dict[str, int]:
    """Emulate a device until it is told to end; return what it has counted.

    ``when_ready`` is called once it can be reached. With ``parent`` it ends as soon as that process is no longer its
    parent. SIGUSR1 presses the emergency stop. Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    should_end = _End(parent)
    run = _run_device if settings.firmware is None else _run_firmware
    return run(settings, _warm(_plant(settings), settings.bench.block), when_ready, should_end)


def _run_device(
    settings: EmulatorSettings, plant: Plant, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    if settings.log_output is not None:
        plant = LoggedPlant(plant, settings.log_output)
    with device_end(settings) as (link, options):
        device = _device(settings, plant, link)
        _when_pressed(device.press_emergency_stop)
        when_ready(Ready(settings.wire, options, settings.lockstep, _scheduling(settings), link.largest_block))
        keep_serving(device, should_end)
    return {**device.counts, **{name: count for name, count in link.counters.items() if count}}


def _run_firmware(
    settings: EmulatorSettings, plant: Plant, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    scheduling = _scheduling(settings)  # before it starts, for a child inherits it
    with started(settings, plant) as firmware:
        _when_pressed(firmware.press_emergency_stop)
        options, most = driver_options_of(settings, firmware.port), largest_block(settings) or LARGEST_BLOCK
        when_ready(Ready(settings.wire, options, settings.lockstep, scheduling, min(most, LARGEST_BLOCK)))
        if not firmware.serve(should_end):
            raise firmware.failure()
        return firmware.end()


def _scheduling(settings: EmulatorSettings) -> str:
    return "ordinary scheduling" if settings.lockstep else ask_for_priority()


def _when_pressed(press: Callable[[], None]) -> None:
    if hasattr(signal, "SIGUSR1"):
        signal.signal(signal.SIGUSR1, lambda *_: press())


def _plant(settings: EmulatorSettings) -> Plant:
    names = tuple(channel.name for channel in settings.bench.channels)
    wiring = Wiring(names, settings.flip, settings.dead, settings.swap)
    return VirtualPlant(settings.bench, settings.seed, wiring)


def _warm(plant: Plant, block: int) -> Plant:
    """Compile the kernels before a host waits for samples."""
    plant.reset()
    plant.step(np.zeros(block))
    plant.reset()
    return plant


def _device(settings: EmulatorSettings, plant: Plant, link: Link) -> Device:
    faults = Faults(**settings.faults)
    simulated = 0 if settings.as_hardware else 2 if settings.lockstep else 1
    words = described(
        plant, simulated=simulated, serial_number=settings.serial_number, layout_crc=link.layout_crc, boot=os.getpid()
    )
    return Device(plant, words, link, lockstep=settings.lockstep, faults=faults)
