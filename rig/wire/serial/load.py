"""What a stream asks of a serial line."""

import math

from rig.wire.link import Load
from rig.wire.messages import HEARTBEATS_HZ, Stream
from rig.wire.serial.codec import HEARTBEAT_BODY, Codec
from rig.wire.serial.frames import largest_frame

__all__ = ["line_load"]

BITS_A_BYTE = 10  # 8N1: start, eight bits, stop


def line_load(stream: Stream, baud: int | None) -> Load:
    """Bits per second against those of the line; None for a line without a rate.

    Of the direction from the device alone: the line carries both at a time, and outputs are always less than samples.
    """
    blocks_hz = stream.rate_hz / stream.block
    samples = largest_frame(Codec.sizes(stream)[0])
    heartbeat = largest_frame(HEARTBEAT_BODY.size) + 1  # and the zero before it
    needed = BITS_A_BYTE * (blocks_hz * samples + HEARTBEATS_HZ * heartbeat)
    terms = f"{blocks_hz:g}/s x {samples} bytes of samples + {HEARTBEATS_HZ}/s x {heartbeat} bytes of heartbeats"
    carried = "a pseudo-terminal carries any" if baud is None else f"{baud} baud carry {baud / 1e3:g} kbit/s"
    sum_text = f"({terms}) x {BITS_A_BYTE} bits = {needed / 1e3:.1f} kbit/s; {carried}"
    return Load(needed, math.inf if baud is None else float(baud), sum_text)
