"""A wire in memory, with its own time: the device at its far end runs while the host waits for it."""

import math
from collections import deque

from rig.bench import Bench
from rig.drivers.wire import WireDAQ, WireOptions
from rig.emulator import Device, Faults, VirtualPlant, Wiring
from rig.emulator.parameters import described
from rig.errors import DaqDisconnected
from rig.wire.link import Link, Load
from rig.wire.messages import Message, Stream

FLIGHT_S = 20e-6


class MemoryWire:
    """Messages under way each way, and a clock that only goes on while the host waits."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.to_device: deque[Message] = deque()
        self.to_host: deque[Message] = deque()
        self.device: Device | None = None
        self.cut = False

    def clock(self) -> float:
        return self.now_s

    def run_device(self) -> None:
        assert self.device is not None
        while self.to_device:
            self.device.handle(self.to_device.popleft(), self.now_s)
        self.device.advance(self.now_s)

    def pass_time(self, seconds: float) -> None:
        """Let the device run while the host does something else."""
        until = self.now_s + seconds
        while True:
            self.run_device()
            assert self.device is not None
            if self.device.wake_s >= until:
                break
            self.now_s = max(self.now_s, self.device.wake_s)
        self.now_s = until
        self.run_device()


class MemoryLink(Link):
    """One end of it."""

    def __init__(self, wire: MemoryWire, host: bool, available_bit_s: float = math.inf) -> None:
        super().__init__("memory")
        self.wire, self.host, self.available_bit_s = wire, host, available_bit_s
        self.stream: Stream | None = None
        self.is_open = False

    def open(self) -> None:
        self.is_open = True

    def configure(self, stream: Stream) -> None:
        self.stream = stream

    def send(self, message: Message) -> None:
        if self.wire.cut:
            raise DaqDisconnected(f"{self.name}: the cable is unplugged")
        (self.wire.to_device if self.host else self.wire.to_host).append(message)

    def receive(self, timeout_s: float) -> Message | None:
        wire = self.wire
        if wire.cut:
            raise DaqDisconnected(f"{self.name}: the cable is unplugged")
        if not self.host:
            return wire.to_device.popleft() if wire.to_device else None
        until = wire.now_s + timeout_s
        wire.now_s += FLIGHT_S
        while not wire.to_host:
            wire.run_device()
            assert wire.device is not None
            if wire.to_host:
                break
            if wire.device.wake_s > until:
                wire.now_s = until
                return None
            wire.now_s = max(wire.now_s + 1e-9, wire.device.wake_s)
        return wire.to_host.popleft()

    def load(self, stream: Stream) -> Load:
        needed = stream.rate_hz / stream.block * 8.0 * (12 + 2 * stream.block * stream.n_channels)
        return Load(needed, self.available_bit_s, f"{needed:g} of {self.available_bit_s:g} bit/s")

    def close(self) -> None:
        self.is_open = False


class MemoryDAQ(WireDAQ):
    """The protocol's host over a wire in memory, with an emulated device at its end."""

    def __init__(
        self,
        bench: Bench,
        seed: int = 0,
        options: WireOptions | None = None,
        *,
        lockstep: bool = True,
        faults: Faults | None = None,
        wiring: dict | None = None,
        available_bit_s: float = math.inf,
        **description,
    ) -> None:
        super().__init__(bench, seed, options or WireOptions())
        self.wire = MemoryWire()
        self.clock = self.wire.clock
        self.available_bit_s = available_bit_s
        names = tuple(channel.name for channel in bench.channels)
        plant = VirtualPlant(bench, seed, Wiring(names, **(wiring or {})))
        words = described(plant, **description)
        self.device = Device(plant, words, MemoryLink(self.wire, host=False), lockstep=lockstep, faults=faults)
        self.wire.device = self.device

    def _make_link(self) -> Link:
        return MemoryLink(self.wire, host=True, available_bit_s=self.available_bit_s)
