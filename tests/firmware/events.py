"""What happens to a device in a script: its header, its records, and those that the program of the script writes."""

import struct
from collections.abc import Iterator
from enum import IntEnum
from functools import cache
from typing import NamedTuple

from rig.wire.can.frames import Frame
from rig.wire.can.protocol import Protocol, protocol

HEADER = struct.Struct("<BBBBBBBIIIIIQ")
RECORD = struct.Struct("<QBI")
FRAME = struct.Struct("<HB")

SERIAL, CAN, CAN_FD = range(3)
BOOT = 0x0001_00FE
BEGIN_US = 1_000_000


class Kind(IntEnum):
    """Kinds of records."""

    NOTHING = 0
    BYTES = 1
    FRAME = 2
    PRESS = 3
    RELEASE = 4
    SHUT = 5
    OPEN = 6
    RESET = 7
    MISS = 8
    COUNTERS = 9


class Choice(NamedTuple):
    """The device of a script."""

    wire: int = SERIAL
    n_channels: int = 4
    bits: int = 16
    node: int = 1
    simulated: int = 1
    lockstep: bool = False
    defect: int = 0
    """Of its description: ``make_a_mistake`` in firmware/boards/script/bench.c."""
    lowest_rate_mhz: int = 1_000
    highest_rate_mhz: int = 1_000_000
    shortest_watchdog_us: int = 1_000
    longest_watchdog_us: int = 4_000_000_000

    @property
    def fd(self) -> bool:
        return self.wire == CAN_FD

    def header(self) -> bytes:
        return HEADER.pack(*self, BOOT, BEGIN_US)


class Event(NamedTuple):
    """A record."""

    time_us: int
    kind: Kind
    data: bytes = b""

    def packed(self) -> bytes:
        return RECORD.pack(self.time_us, self.kind, len(self.data)) + self.data


def of_frame(time_us: int, frame: Frame) -> Event:
    return Event(time_us, Kind.FRAME, FRAME.pack(frame.identifier, frame.fd) + frame.data)


def frame_of(data: bytes) -> Frame:
    identifier, fd = FRAME.unpack_from(data)
    return Frame(identifier, data[FRAME.size :], bool(fd))


def events_in(data: bytes) -> Iterator[Event]:
    at = 0
    while at < len(data):
        time_us, kind, length = RECORD.unpack_from(data, at)
        at += RECORD.size + length
        yield Event(time_us, Kind(kind), data[at - length : at])


@cache
def protocol_of(n_channels: int, fd: bool, node: int) -> Protocol:
    """The definition of a bus, which takes a while to compile."""
    return protocol(n_channels, fd, node)
