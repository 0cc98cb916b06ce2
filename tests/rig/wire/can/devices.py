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
    link = CanLink(bus, 4, BusTiming(fd), node, device=True)
    plant = VirtualPlant(load_bench("magnet-beam"))
    plant.reset()
    plant.step(np.zeros(1))  # compiled now, and not while the host waits for an answer
    words = described(plant, layout_crc=link.layout_crc, serial_number=serial_number)
    device = Device(plant, words, link, lockstep=True, faults=faults)
    link.open()
    ended = threading.Event()

    def work() -> None:
        while not ended.is_set():
            message = link.receive(0.01)
            if message is not None:
                device.handle(message, time.monotonic())
            device.advance(time.monotonic())

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield device
    finally:
        ended.set()
        thread.join()
        link.close()
