"""An emulated device on a bus, run by a thread of the test, in lockstep with its host."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from rig.bench import Bench, DriverChoice, load_bench
from rig.emulator import Device, Faults, VirtualPlant
from rig.emulator.parameters import described
from rig.wire.can.bus import FrameBus
from rig.wire.can.frames import BusTiming
from rig.wire.can.link import CanLink


def bench_on(interface: str, channel: str, block: int = 4, **options: object) -> Bench:
    """The magnet beam with a CAN driver."""
    driver = DriverChoice(name="can", options={"interface": interface, "channel": channel, "timeout_s": 5.0, **options})
    return load_bench("magnet-beam").model_copy(update={"driver": driver, "block": block})


@contextmanager
def device_on(
    bus: FrameBus, fd: bool, node: int = 1, faults: Faults | None = None, serial_number: str = "0001"
) -> Iterator[Device]:
    """A device at work until the block ends."""
    made = _made(bus, fd, node, faults, serial_number)
    with _at_work(made):
        yield made[1]


@contextmanager
def two_devices_on(first: FrameBus, second: FrameBus) -> Iterator[None]:
    """Two devices under one node of CAN FD. They take turns, so that neither falls behind on a busy computer."""
    with _at_work(*(_made(bus, True, 1, None, number) for bus, number in ((first, "0001"), (second, "0002")))):
        yield


def _made(bus: FrameBus, fd: bool, node: int, faults: Faults | None, serial_number: str) -> tuple[CanLink, Device]:
    link = CanLink(bus, 4, BusTiming(fd), node, device=True)
    plant = VirtualPlant(load_bench("magnet-beam"))
    plant.reset()
    plant.step(np.zeros(1))  # compiled now, and not while the host waits for an answer
    words = described(plant, layout_crc=link.layout_crc, serial_number=serial_number)
    return link, Device(plant, words, link, lockstep=True, faults=faults)


@contextmanager
def _at_work(*made: tuple[CanLink, Device]) -> Iterator[None]:
    """Serve devices in a thread until the block ends."""
    for link, _ in made:
        link.open()
    ended = threading.Event()

    def work() -> None:
        while not ended.is_set():
            for link, device in made:
                message = link.receive(0.01)
                if message is not None:
                    device.handle(message, time.monotonic())
                device.advance(time.monotonic())

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        for link, _ in made:
            link.close()
