"""Messages as they are on a serial line and on a CAN bus, one after the other, and what may happen to them there."""

import random
from collections.abc import Callable
from typing import Protocol

from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame
from rig.wire.can.protocol import protocol
from rig.wire.messages import Message, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame, payload_of


class Line(Protocol):
    """One direction of a wire: what a message is on it, what comes out, and what a damaged or a forged frame looks like."""

    def configure(self, stream: Stream) -> None:
        """Agree on the shape of samples and outputs."""

    def encode(self, message: Message) -> list[bytes]:
        """The frames of a message."""

    def decode(self, data: bytes) -> list[Message]:
        """The messages that are complete with a frame, or with whatever came in its place."""

    def damaged(self, data: bytes, chance: random.Random) -> bytes:
        """A frame that has come to harm on its way, which the line can tell."""

    def forged(self, data: bytes, chance: random.Random) -> bytes:
        """A frame of other content that is right in its form."""


def _flipped(data: bytes, chance: random.Random, bits: int) -> bytes:
    changed = bytearray(data)
    for _ in range(bits if changed else 0):
        changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _mixed(data: bytes, chance: random.Random) -> bytes:
    """Content that another message may have: some bits, or some bytes, or another length."""
    kind = chance.randrange(4)
    if kind == 0:
        return _flipped(data, chance, chance.choice((1, 1, 2, 8)))
    if kind == 1:
        at = chance.randrange(len(data) + 1)
        return (
            data[:at]
            + bytes(chance.choice((0, 255, chance.randrange(256))) for _ in data[at : at + 8])
            + data[at + 8 :]
        )
    if kind == 2:
        return data[: chance.randrange(len(data) + 1)]
    return data + chance.randbytes(chance.randrange(1, 40))


class SerialLine:
    """COBS frames with a CRC-32."""

    def __init__(self, n_channels: int, to_device: bool) -> None:
        self._codec = Codec()
        self.counters: dict[str, int] = {}
        self._reader = FrameReader(self._codec, self.counters)

    def configure(self, stream: Stream) -> None:
        self._codec.configure(stream)
        self._reader.configure(stream)

    def encode(self, message: Message) -> list[bytes]:
        return [frame(self._codec.encode(message))]

    def decode(self, data: bytes) -> list[Message]:
        return self._reader.feed(data)

    def damaged(self, data: bytes, chance: random.Random) -> bytes:
        kind = chance.randrange(5)
        if kind == 0:
            return _flipped(data[:-1], chance, chance.choice((1, 2, 3))) + b"\0"
        if kind == 1:
            return data[: chance.randrange(len(data))]
        if kind == 2:
            return data[chance.randrange(len(data)) :]
        if kind == 3:
            return chance.randbytes(chance.choice((3, 40, 400, 4000, 20_000))) + b"\0" + data
        return b""

    def forged(self, data: bytes, chance: random.Random) -> bytes:
        return frame(_mixed(payload_of(data[:-1]), chance))


class CanLine:
    """Frames of the shipped definition; as bytes: identifier and flags, then data. The bus itself tells flipped bits."""

    def __init__(self, n_channels: int, to_device: bool) -> None:
        self.counters: dict[str, int] = {}
        known = protocol(n_channels, True, 3)
        self._codecs = [CanCodec(known, device, {}) for device in (not to_device, to_device)]
        self._identifiers = sorted(known.kinds)

    def configure(self, stream: Stream) -> None:
        for codec in self._codecs:
            codec.configure(stream)

    def encode(self, message: Message) -> list[bytes]:
        return [_as_bytes(one) for one in self._codecs[0].encode(message)]

    def decode(self, data: bytes) -> list[Message]:
        found = self._codecs[1].decode(_as_frame(data)) if len(data) >= 3 else None
        return [] if found is None else [found]

    def damaged(self, data: bytes, chance: random.Random) -> bytes:
        return b""

    def forged(self, data: bytes, chance: random.Random) -> bytes:
        one = _as_frame(data)
        identifier = chance.choice(
            (one.identifier, one.identifier, chance.choice(self._identifiers), chance.randrange(2048))
        )
        flags = chance.random() < 0.9
        return _as_bytes(Frame(identifier, _mixed(one.data, chance)[:64], flags, chance.random() < 0.02))


def _as_bytes(one: Frame) -> bytes:
    return one.identifier.to_bytes(2, "little") + bytes([one.fd | one.extended << 1]) + one.data


def _as_frame(data: bytes) -> Frame:
    return Frame(int.from_bytes(data[:2], "little"), data[3:], bool(data[2] & 1), bool(data[2] & 2))


LINES: dict[str, Callable[[int, bool], Line]] = {"serial": SerialLine, "can": CanLine}
