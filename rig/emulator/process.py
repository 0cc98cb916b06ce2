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
from rig.emulator.plant import OutputLog, VirtualPlant, Wiring
from rig.emulator.ports import device_end, driver_options_of
from rig.emulator.settings import EmulatorSettings
from rig.errors import DaqRefused
from rig.system.privileges import prepare

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


def _ending(parent: int | None) -> Callable[[], bool]:
    """What tells whether to end: after SIGTERM, SIGINT or SIGHUP, or when the parent process is gone."""
    told: list[int] = []
    for name in ("SIGTERM", "SIGINT", "SIGHUP"):
        if hasattr(signal, name):  # SIGHUP does not exist on every system
            signal.signal(getattr(signal, name), lambda number, _: told.append(number))
    return lambda: bool(told) or (parent is not None and os.getppid() != parent)


def run_emulator(
    settings: EmulatorSettings, when_ready: Callable[[Ready], None], *, parent: int | None = None
) -> dict[str, int]:
    """Emulate a device until it is told to end; return what it has counted.

    ``when_ready`` is called once it can be reached. With ``parent`` it ends as soon as that process is no longer its
    parent. SIGUSR1 presses the emergency stop. Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    should_end = _ending(parent)
    if settings.wire == "sound":
        return _run_sound_card(settings, when_ready, should_end)
    if settings.wire == "nidaqmx":
        return _run_device_server(settings, when_ready, should_end)
    names = tuple(channel.name for channel in settings.bench.channels)
    wiring = Wiring(names, settings.flip, settings.dead, settings.swap)
    plant = VirtualPlant(settings.bench, settings.seed, wiring)
    plant.step(np.zeros(settings.bench.block))  # compiles the kernels before a host waits for samples
    plant.reset()
    run = _run_device if settings.firmware is None else _run_firmware
    return run(settings, plant, when_ready, should_end)


def _run_device(
    settings: EmulatorSettings, plant: VirtualPlant, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    if settings.log_output is not None:
        plant.log = OutputLog(settings.log_output)
    with device_end(settings) as (link, options):
        number, crc = settings.serial_number, link.layout_crc
        words = described(plant, simulated=settings.simulated, serial_number=number, layout_crc=crc, boot=os.getpid())
        device = Device(plant, words, link, lockstep=settings.lockstep, faults=Faults(**settings.faults))
        _when_pressed(device.press_emergency_stop)
        when_ready(Ready(settings.wire, options, settings.lockstep, _scheduling(settings), link.largest_block))
        keep_serving(device, should_end)
    return {**device.counts, **{name: count for name, count in link.counters.items() if count}}


def _run_firmware(
    settings: EmulatorSettings, plant: VirtualPlant, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    scheduling = _scheduling(settings)  # before it starts, for a child inherits it
    with started(settings, plant) as firmware:
        _when_pressed(firmware.press_emergency_stop)
        options, most = driver_options_of(settings, firmware.port), LARGEST_BLOCK
        if settings.wire == "can":
            from rig.wire.can.protocol import shape_of

            most = min(most, shape_of(len(settings.bench.channels), settings.fd).largest_block)
        when_ready(Ready(settings.wire, options, settings.lockstep, scheduling, most))
        if not firmware.serve(should_end):
            raise firmware.failure()
        return firmware.end()


def _run_sound_card(
    settings: EmulatorSettings, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    from rig.emulator.sound import run_sound_card

    scheduling = _scheduling(settings)

    def found(options: Table) -> None:
        when_ready(Ready("sound", options, False, scheduling, LARGEST_BLOCK))

    return run_sound_card(settings, found, should_end)


def _run_device_server(
    settings: EmulatorSettings, when_ready: Callable[[Ready], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    try:
        from rig.emulator.nidaqmx.server import run_device_server
    except ImportError:
        raise DaqRefused("the package nidaqmx is not installed (pip install 'nidaqmx[grpc]==1.7.*')") from None

    scheduling = _scheduling(settings)

    def found(options: Table) -> None:
        when_ready(Ready("nidaqmx", options, settings.lockstep, scheduling, LARGEST_BLOCK))

    return run_device_server(settings, found, should_end)


def _scheduling(settings: EmulatorSettings) -> str:
    """Request real-time scheduling and locked memory for a device with a clock; return the scheduling granted."""
    if settings.lockstep:
        return "ordinary scheduling"
    granted = prepare(priority=PRIORITY)["scheduling"]
    return granted if granted.startswith("SCHED") else "ordinary scheduling"


def _when_pressed(press: Callable[[], None]) -> None:
    if hasattr(signal, "SIGUSR1"):
        signal.signal(signal.SIGUSR1, lambda *_: press())
