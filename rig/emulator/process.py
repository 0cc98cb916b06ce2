"""The emulator: a virtual rig behind a wire, until it is told to end."""

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.emulator.description import described
from rig.emulator.device import Device
from rig.emulator.faults import Faults
from rig.emulator.output_log import LoggedPlant
from rig.emulator.pace import ask_for_priority, keep_serving
from rig.emulator.plant import Plant, VirtualPlant, Wiring
from rig.emulator.ports import device_end
from rig.emulator.settings import EmulatorSettings
from rig.wire.link import Link

__all__ = ["Ready", "run_emulator"]


@dataclass
class Ready:
    """What there is to say once an emulator can be reached."""

    wire: str
    options: dict[str, Any]
    """Driver options of a bench that reaches it."""
    lockstep: bool
    scheduling: str
    largest_block: int
    """Samples that a block may have on this wire."""
    process: int = field(default_factory=os.getpid)


class _End:
    """Whether to end: on SIGTERM, SIGINT or SIGHUP, or once the process that wanted the emulator is gone."""

    def __init__(self, parent: int | None) -> None:
        self._parent = parent
        self._told = False
        for name in ("SIGTERM", "SIGINT", "SIGHUP"):
            if hasattr(signal, name):  # the last not on every system
                signal.signal(getattr(signal, name), self._tell)

    def _tell(self, _number: int, _frame: object) -> None:
        self._told = True

    def __call__(self) -> bool:
        return self._told or (self._parent is not None and os.getppid() != self._parent)


def run_emulator(
    settings: EmulatorSettings, when_ready: Callable[[Ready], None], *, parent: int | None = None
) -> dict[str, int]:
    """Emulate a device until told to end; returns what it counted.

    ``when_ready`` is called once it can be reached. With ``parent`` it ends as soon as that process is no longer its
    parent. SIGUSR1 presses the emergency stop. Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    should_end = _End(parent)
    plant = _plant(settings)
    with device_end(settings) as (link, options):
        device = _device(settings, plant, link)
        if hasattr(signal, "SIGUSR1"):
            signal.signal(signal.SIGUSR1, lambda *_: device.press_emergency_stop())
        scheduling = "ordinary scheduling" if settings.lockstep else ask_for_priority()
        when_ready(Ready(settings.wire, options, settings.lockstep, scheduling, link.largest_block))
        keep_serving(device, should_end)
    return {**device.counts, **{name: count for name, count in link.counters.items() if count}}


def _plant(settings: EmulatorSettings) -> Plant:
    names = tuple(channel.name for channel in settings.bench.channels)
    wiring = Wiring(names, settings.flip, settings.dead, settings.swap)
    plant: Plant = VirtualPlant(settings.bench, settings.seed, wiring)
    if settings.log_output is not None:
        plant = LoggedPlant(plant, settings.log_output)
    plant.reset()
    plant.step(np.zeros(settings.bench.block))  # what has to be compiled is compiled before anybody waits for it
    plant.reset()
    return plant


def _device(settings: EmulatorSettings, plant: Plant, link: Link) -> Device:
    faults = Faults(**settings.faults)
    simulated = 0 if settings.as_hardware else 2 if settings.lockstep else 1
    words = described(
        plant, simulated=simulated, serial_number=settings.serial_number, layout_crc=link.layout_crc, boot=os.getpid()
    )
    return Device(plant, words, link, lockstep=settings.lockstep, faults=faults)
