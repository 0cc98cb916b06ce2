"""A wire in memory whose messages to the host are bytes on a serial line on their way, where anything may happen to them."""

from collections import deque
from collections.abc import Callable
from typing import Any

from rig.bench import Bench
from rig.drivers.wire import WireOptions
from rig.wire.link import Link
from rig.wire.messages import Message, Samples, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from tests.rig.wire.memory_link import MemoryDAQ, MemoryLink, MemoryWire


class MangledLink(MemoryLink):
    """The host's end: every block of samples goes through ``mangle``, which is given its frame and its number from 1."""

    def __init__(self, wire: MemoryWire, mangle: Callable[[bytes, int], bytes]) -> None:
        super().__init__(wire, host=True)
        self._mangle = mangle
        self._codec = Codec()
        self._reader = FrameReader(self._codec, self.counters)
        self._blocks = 0
        self._read: deque[Message] = deque()

    def speak(self, version: int) -> None:
        super().speak(version)
        self._codec.version = version

    def configure(self, stream: Stream) -> None:
        super().configure(stream)
        self._codec.configure(stream)
        self._reader.configure(stream)

    def receive(self, timeout_s: float) -> Message | None:
        while not self._read:
            message = super().receive(timeout_s)
            if message is None:
                return None
            data = frame(self._codec.encode(message))
            if isinstance(message, Samples):
                self._blocks += 1
                data = self._mangle(data, self._blocks)
            self._read.extend(self._reader.feed(data))
        return self._read.popleft()


class MangledDAQ(MemoryDAQ):
    """The protocol's host behind such a line."""

    def __init__(
        self, bench: Bench, seed: int, options: WireOptions, mangle: Callable[[bytes, int], bytes], **kwargs: Any
    ) -> None:
        super().__init__(bench, seed, options, **kwargs)
        self._mangle = mangle

    def _make_link(self) -> Link:
        return MangledLink(self.wire, self._mangle)
