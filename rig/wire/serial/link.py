"""`SerialLink`: one end of the protocol on a serial line, and what a stream asks of the line."""

import math
import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from select import select
from typing import Self

from rig.errors import DaqDisconnected, DaqTimeout
from rig.wire.link import LATE_SHARE, Link, Load
from rig.wire.messages import HEARTBEATS_HZ, STATE_BYTES, VERSION, Message, Output, Readback, Rows, Samples, Stream
from rig.wire.serial.codec import HEARTBEAT_BODY, Codec
from rig.wire.serial.frames import FrameReader, frame, largest_frame
from rig.wire.serial.port import is_pseudo_terminal
from rig.wire.serial.reading import Input, PolledInput, TimedInput

BITS_A_BYTE = 10  # 8N1: start, eight bits, stop


def line_load(stream: Stream, baud: int | None, version: int = VERSION) -> Load:
    """Bits per second that a stream needs against the baud rate; None is a line without a rate.

    Only the direction from the device counts: the line carries both at once, and outputs are always fewer than samples. In
    version 2 one block in twenty is counted as late, with its readback.
    """
    blocks_hz = stream.rate_hz / stream.block
    samples_size, _, readback_size = Codec.sizes(stream, version)
    samples = largest_frame(samples_size)
    heartbeat = largest_frame(HEARTBEAT_BODY.size) + 1  # and the zero before it
    needed = BITS_A_BYTE * (blocks_hz * samples + HEARTBEATS_HZ * heartbeat)
    terms = f"{blocks_hz:g}/s x {samples} bytes of samples + {HEARTBEATS_HZ}/s x {heartbeat} bytes of heartbeats"
    if stream.loop:
        state = largest_frame(STATE_BYTES) + 1
        needed += BITS_A_BYTE * stream.states_hz * state
        terms += f" + {stream.states_hz:g}/s x {state} bytes of the loop's state"
    elif readback_size:
        late_hz, readback = LATE_SHARE * blocks_hz, largest_frame(readback_size)
        needed += BITS_A_BYTE * late_hz * readback
        terms += f" + {late_hz:g}/s x {readback} bytes of readbacks"
    carried = "a pseudo-terminal carries any" if baud is None else f"{baud} baud carry {baud / 1e3:g} kbit/s"
    sum_text = f"({terms}) x {BITS_A_BYTE} bits = {needed / 1e3:.1f} kbit/s; {carried}"
    return Load(needed, math.inf if baud is None else float(baud), sum_text)


STREAMED = (Samples, Output, Readback, Rows)
WRITE_TIMEOUT_S = 0.1  # for a line that takes no more bytes; far beyond what a working one needs


class SerialLink(Link):
    """One end of a serial line.

    A write that the line does not take within ``write_timeout_s`` raises `DaqTimeout`; what has been begun of a frame is
    finished first, so that the other end sees whole frames. Not to be used from two threads at a time.

    A read may bring many frames. On Linux and macOS; Windows gives no descriptors, and `open` says so.
    """

    def __init__(
        self, name: str, opener: Callable[[ExitStack], tuple[int, Input]], baud: int, write_timeout_s: float
    ) -> None:
        super().__init__(name)
        self._opener = opener
        self._baud = baud
        self._write_timeout_s = write_timeout_s
        self._descriptor = -1
        self._input: Input = Input()
        self._held = ExitStack()
        self._codec = Codec()
        self._reader = FrameReader(self._codec, self.counters)
        self._received: deque[Message] = deque()
        self._unfinished = b""
        self.counters["unsent_frames"] = 0

    @classmethod
    def port(cls, path: str, baud: int, write_timeout_s: float = WRITE_TIMEOUT_S) -> Self:
        """The host's end: a serial port by its name, or the far end of a pseudo-terminal."""

        def opened(held: ExitStack) -> tuple[int, Input]:
            from rig.wire.serial.port import open_port, second_descriptor

            port = open_port(path, baud)
            held.callback(port.close)
            writer = second_descriptor(path)
            held.callback(os.close, writer)
            return writer, TimedInput(port.fileno())

        return cls(path, opened, baud, write_timeout_s)

    @classmethod
    def on(cls, descriptor: int, name: str, baud: int = 0, write_timeout_s: float = 0.0) -> Self:
        """A descriptor that is open already and stays the caller's, such as the near end of a pseudo-terminal."""

        def opened(held: ExitStack) -> tuple[int, Input]:
            waiting = PolledInput(descriptor)
            held.callback(waiting.close)
            return descriptor, waiting

        return cls(name, opened, baud, write_timeout_s)

    def open(self) -> None:
        """Open the port and forget what it still held; nothing is sent."""
        self.close()
        with ExitStack() as held:
            self._descriptor, self._input = self._opener(held)
            self._held = held.pop_all()
        self._reader = FrameReader(self._codec, self.counters)

    def speak(self, version: int) -> None:
        """Use a version of the protocol from now on."""
        super().speak(version)
        self._codec.version = version

    def configure(self, stream: Stream) -> None:
        """Agree on the shape of samples and outputs."""
        self._codec.configure(stream)
        self._reader.configure(stream)

    def send(self, message: Message) -> None:
        """Send one message. `DaqTimeout`: the line takes no more bytes, and nothing of the message was sent."""
        data = frame(self._codec.encode(message))
        if message.__class__ not in STREAMED:
            data = b"\0" + data  # a leading zero ends a false frame that noise on the idle line may have begun
        if self._unfinished:
            data = self._unfinished + data
        written = self._write(data)
        if written < len(data):
            self._send_slowly(data, written)
        elif self._unfinished:
            self._unfinished = b""

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message, or None after ``timeout_s``."""
        received = self._received
        if received:
            return received.popleft()
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                data = self._input.read(timeout_s)
            except (OSError, ValueError) as error:
                raise self._gone(error) from error
            messages = self._reader.feed(data) if data else None
            if messages:
                if len(messages) > 1:
                    received.extend(messages[1:])
                return messages[0]
            timeout_s = deadline - time.monotonic()
            if timeout_s <= 0.0:
                return None

    def load(self, stream: Stream) -> Load:
        """Bits per second of the busier direction, ten a byte, against the baud rate; once open."""
        unlimited = not self._baud or is_pseudo_terminal(self._descriptor)
        return line_load(stream, None if unlimited else self._baud, self.version)

    def largest_block_of(self, n_channels: int, bits: int) -> int:
        """Largest number of samples in a block: the payload of a frame is bounded."""
        return Codec.largest_block(n_channels, bits)

    def close(self) -> None:
        """Close the port."""
        self._descriptor, self._input = -1, Input()
        self._received.clear()
        self._unfinished = b""
        with suppress(Exception):  # errors of a vanished port differ by system, and the port is gone in any case
            self._held.close()

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._gone(error) from error

    def _send_slowly(self, data: bytes, written: int) -> None:
        old = len(self._unfinished)
        deadline = time.monotonic() + self._write_timeout_s
        while written < len(data) and (left_s := deadline - time.monotonic()) > 0.0:
            try:
                select((), (self._descriptor,), (), left_s)
            except (OSError, ValueError) as error:
                raise self._gone(error) from error
            written += self._write(data[written:])
        if written > old:
            self._unfinished = data[written:]  # the rest is sent before the next message
            return
        self._unfinished = data[written:old]
        self.counters["unsent_frames"] += 1
        raise DaqTimeout(f"{self.name}: the line takes no more bytes: the other end does not read")

    def _gone(self, why: object) -> DaqDisconnected:
        if self._descriptor < 0:
            return DaqDisconnected(f"{self.name}: the port is not open")
        return DaqDisconnected(f"the port is gone (unplugged or switched off): {why}", where=self.name)
