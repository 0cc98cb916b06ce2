"""What no host sends: damaged, cut and foreign frames, blocks of outputs torn on their way, indices that lie."""

import struct
from typing import TYPE_CHECKING

from rig.wire.can.frames import FD_LENGTHS, Frame
from rig.wire.serial.frames import frame
from tests.firmware.events import Kind

if TYPE_CHECKING:
    from tests.firmware.host import Host


def nonsense_on_the_line(host: "Host") -> None:
    random = host.random
    request = struct.pack("<BBHBBBBI", 1, 1, 0, random.randrange(256), 4, 0, 0, 0)
    counts = host.counts(host.block).tobytes()
    output = host.output_head(0, random.choice((0, 1, 2**32, 2**63, 2**64 - host.block))) + counts
    heartbeat = struct.pack("<BBHBBHII", host.version, 5, 0, 0, 0, 0, 0, 0)
    payload = random.choice((request, output, output, heartbeat, random.randbytes(random.randrange(40))))
    kind = random.randrange(7)
    if kind == 0:
        payload = bytes((random.randrange(256),)) + payload[1:]  # another version
    elif kind == 1:
        payload = payload[:1] + bytes((random.randrange(256),)) + payload[2:]  # another type
    elif kind == 2:
        payload = payload[: random.randrange(len(payload) + 1)]
    elif kind == 3:
        payload += random.randbytes(random.randrange(9))
    line = bytearray(frame(payload))
    if kind == 4:
        line[random.randrange(len(line))] ^= 1 << random.randrange(8)
    elif kind == 5:
        line = line[: random.randrange(len(line))] + b"\0" * random.randrange(2)
    elif kind == 6:
        line = bytearray(random.randbytes(random.choice((1, 10, 300, 5000))) + b"\0" * random.randrange(3))
    host.happens(Kind.BYTES, bytes(line))
    if line[-1:] != b"\0":
        host.happens(Kind.BYTES, b"\0")


def nonsense_on_the_bus(host: "Host") -> None:
    random, node = host.random, host.choice.node
    kind = random.randrange(8)
    if kind == 0:
        identifier = random.choice((random.randrange(1, 0x800), 0x010 + node, 0x030 + node, 0x300 + node))
        host.send_frame(_any_frame(host, identifier))
    elif kind == 1:
        host.send_frame(_any_frame(host, 0x100 + 16 * random.randrange(33) + node))
    elif kind == 2:
        first = random.choice((0, host.next_block * host.block, random.randrange(2**32), 2**32 - 1))
        host.send_frame(Frame(0x040 + node, struct.pack("<I", first) + bytes(random.choice((0, 0, 0, 1)))))
    elif kind == 3:
        host.send_frame(Frame(0x020 + node, random.randbytes(random.choice((0, 7, 6)))))
    elif kind == 4:
        _send_torn_outputs(host)
    elif kind == 5:
        host.send_frame(Frame(0x050 + node, random.randbytes(random.choice((0, 4, 7, 8)))))
    else:
        _send_mangled_output(host)


def _any_frame(host: "Host", identifier: int) -> Frame:
    fd = host.random.random() < (0.8 if host.choice.fd else 0.1)
    return Frame(identifier, host.random.randbytes(host.random.choice(FD_LENGTHS if fd else range(9))), fd)


def _send_torn_outputs(host: "Host") -> None:
    """The first frames of more blocks than may be incomplete at a time, and then what was missing of some."""
    numbers = [host.next_block + host.queue + ahead for ahead in range(host.random.choice((2, 5, 6, 7)))]
    blocks = [host.output_frames(number, host.counts(host.block)) for number in numbers]
    host.random.shuffle(blocks)
    for frames in blocks:
        for one in frames[:-1]:
            host.send_frame(one)
    for frames in host.random.sample(blocks, 2):
        host.send_frame(frames[-1])


def _send_mangled_output(host: "Host") -> None:
    """A block of outputs of which frames are lost, doubled, swapped, or contradict each other."""
    random = host.random
    half = host.half_a_wrap
    number = max(0, host.next_block + host.queue + random.choice((0, 0, 0, 1, 20, 200, half - 1, half, half + 1)))
    frames = host.output_frames(number, host.counts(host.block))
    for _ in range(random.randrange(1, 4)):
        at = random.randrange(len(frames)) if frames else 0
        kind = random.randrange(6)
        if frames and kind == 0:
            del frames[at]
        elif frames and kind == 1:
            frames.insert(random.randrange(len(frames)), frames[at])
        elif frames and kind == 2:
            frames.append(frames.pop(at))
        elif frames and kind == 3 and frames[at].data:
            data = bytearray(frames[at].data)
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
            frames.insert(at, frames[at]._replace(data=bytes(data)))
        elif frames and kind == 4:
            frames[at] = frames[at]._replace(identifier=frames[at].identifier + 16)
        elif frames:
            frames[at] = frames[at]._replace(data=frames[at].data[:-1])
    for one in frames:
        if not one.fd or len(one.data) in FD_LENGTHS:
            host.send_frame(one)
