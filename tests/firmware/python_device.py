"""The emulator's device in memory: bytes or frames in and out, and a clock that only goes on when it is told to."""

from collections.abc import Sequence

from rig.emulator import Device
from rig.emulator.parameters import described
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame
from rig.wire.link import Link, Load
from rig.wire.messages import Message, Output, Parameter, Readback, Samples, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from tests.firmware.events import BEGIN_US, BOOT, SERIAL, Choice, Event, Kind, frame_of, of_frame, protocol_of
from tests.firmware.structure import FULL_RANGE_V, RANGE_V, Formula

LONGEST_PERIOD = 2048
"""Samples: that of firmware/core/limits.h."""

MODEL = "a formula behind a simulated clock"
"""Longer than what a parameter holds."""

HAIR_S = 1e-9
"""The device is woken so much late, so that what falls on one instant is due in spite of rounding."""


class SerialEnd(Link):
    """The device's end of a serial line: bytes in, bytes out."""

    def __init__(self) -> None:
        super().__init__("serial line in memory")
        self.sent: list[Event] = []
        self.flags: list[int] = []
        """Flags of the blocks that were sent."""
        self.ramps_us: list[int] = []
        """Setting of the ramp while they were measured, us."""
        self.now_us = self.ramp_us = 0
        self._codec = Codec()
        self._reader = FrameReader(self._codec, self.counters)

    def speak(self, version: int) -> None:
        super().speak(version)
        self._codec.version = version

    def configure(self, stream: Stream) -> None:
        self._codec.configure(stream)
        self._reader.configure(stream)

    def send(self, message: Message) -> None:
        if isinstance(message, Samples):
            self.flags.append(message.flags)
            self.ramps_us.append(self.ramp_us)
        self.sent += self._encoded(message)

    def _encoded(self, message: Message) -> list[Event]:
        data = frame(self._codec.encode(message))
        lead = b"" if isinstance(message, Samples | Output | Readback) else b"\0"
        return [Event(self.now_us, Kind.BYTES, lead + data)]

    def feed(self, data: bytes) -> list[Message]:
        return self._reader.feed(data)

    def largest_block_of(self, n_channels: int, bits: int) -> int:
        return Codec.largest_block(n_channels, bits)

    def open(self) -> None: ...

    def close(self) -> None: ...

    def receive(self, timeout_s: float) -> Message | None:
        raise NotImplementedError

    def load(self, stream: Stream) -> Load:
        raise NotImplementedError


class CanEnd(SerialEnd):
    """The device's end of a bus: frames in, frames out."""

    def __init__(self, n_channels: int, fd: bool, node: int) -> None:
        super().__init__()
        self._protocol = protocol_of(n_channels, fd, node)
        self._can_codec = CanCodec(self._protocol, True, self.counters)

    def speak(self, version: int) -> None:
        super().speak(version)
        self._can_codec.speak(version)

    def configure(self, stream: Stream) -> None:
        self._can_codec.configure(stream)

    def _encoded(self, message: Message) -> list[Event]:
        return [of_frame(self.now_us, one) for one in self._can_codec.encode(message)]

    def feed_frame(self, one: Frame) -> list[Message]:
        message = self._can_codec.decode(one)
        return [] if message is None else [message]

    def largest_block_of(self, n_channels: int, bits: int) -> int:
        return self._protocol.shape.largest_block

    @property
    def layout_crc(self) -> int:
        return self._can_codec.protocol.layout.crc


class PythonDevice:
    """A device that is switched on, and what it sends; `play` tells it what happens."""

    def __init__(self, choice: Choice) -> None:
        self.choice = choice
        range_v = FULL_RANGE_V if choice.simulated == 2 else RANGE_V
        self.plant = Formula(choice.n_channels, choice.bits, 1e-3 * choice.highest_rate_mhz, range_v)
        if choice.wire == SERIAL:
            self.link = SerialEnd()
        else:
            self.link = CanEnd(choice.n_channels, choice.fd, choice.node)
        words = described(
            self.plant,
            model=MODEL,
            simulated=choice.simulated,
            layout_crc=self.link.layout_crc,
            boot=BOOT,
        )
        words[Parameter.LONGEST_PERIOD, 0] = LONGEST_PERIOD
        words[Parameter.LOWEST_RATE_MHZ, 0] = choice.lowest_rate_mhz
        words[Parameter.SHORTEST_WATCHDOG_US, 0] = choice.shortest_watchdog_us
        words[Parameter.LONGEST_WATCHDOG_US, 0] = choice.longest_watchdog_us
        for item in range(2) if choice.simulated == 0 else ():  # which may be left out
            del words[Parameter.FILTER_DELAY_S, item]
        self.device = Device(self.plant, words, self.link, lockstep=choice.lockstep)
        self.wakes: list[Event] = []
        """When it has done something of its own accord."""
        self.was_reset = False
        self._at(1e-6 * BEGIN_US)
        self.device.advance(1e-6 * BEGIN_US)

    def _at(self, now_s: float) -> None:
        self.link.now_us = round(1e6 * now_s)
        self.link.ramp_us = self.device.words[Parameter.RAMP_US, 0]

    def pass_time(self, time_us: int) -> None:
        """Do what is due until then."""
        while (wake_s := self.device.wake_s) <= 1e-6 * time_us + HAIR_S:
            self._at(wake_s)
            if wake_s < self.device.due_s - HAIR_S:
                self.wakes.append(Event(round(1e6 * wake_s), Kind.NOTHING))
            self.device.advance(wake_s + HAIR_S)

    def play(self, event: Event) -> None:
        """Let time pass until an event, and let it happen."""
        self.pass_time(event.time_us)
        now_s = 1e-6 * event.time_us
        self._at(now_s)
        if event.kind == Kind.BYTES:
            self._handle(self.link.feed(event.data), now_s)
        elif event.kind == Kind.FRAME:
            assert isinstance(self.link, CanEnd)
            self._handle(self.link.feed_frame(frame_of(event.data)), now_s)
        elif event.kind in (Kind.PRESS, Kind.RELEASE):
            self.device.set_emergency_stop(event.kind == Kind.PRESS, now_s)
        elif event.kind == Kind.RESET:
            self.device.reset(now_s)
            self.was_reset = True
        self.device.advance(now_s)

    def _handle(self, messages: Sequence[Message], now_s: float) -> None:
        for message in messages:
            self.device.handle(message, now_s)

    def script(self, events: Sequence[Event]) -> bytes:
        """The script for the other device: what happens, and when this one does something of its own accord."""
        both = sorted([*self.wakes, *events], key=lambda event: event.time_us)  # stable: wakes before events
        return self.choice.header() + b"".join(event.packed() for event in both)
