"""How the samples or outputs of a block are spread over frames."""

from typing import NamedTuple

import numpy as np

from rig.errors import DaqMismatch, DaqRefused
from rig.wire.can.definition import Shape
from rig.wire.can.frames import Frame, padded_length
from rig.wire.can.protocol import FrameKind, Protocol
from rig.wire.messages import Stream

__all__ = ["COUNT", "Piece", "StreamFrames", "check_stream"]

COUNT = np.dtype("<i2")


def check_stream(shape: Shape, stream: Stream) -> None:
    """Raise `DaqRefused` for a block or a resolution that frames cannot carry, `DaqMismatch` for other channels."""
    if stream.n_channels != shape.n_channels:
        raise DaqMismatch(f"{stream.n_channels} channels, but the bus is defined for {shape.n_channels}")
    if stream.bits != 16:
        raise DaqRefused(f"counts of {stream.bits} bits: allowed over CAN is 16")
    if not 1 <= stream.block <= shape.largest_block:
        raise DaqRefused(
            f"block = {stream.block}: allowed over {'CAN FD' if shape.fd else 'classical CAN'} with "
            f"{shape.n_channels} channels is 1 to {shape.largest_block} samples"
        )


class Piece(NamedTuple):
    """What one frame carries of its block."""

    rows: slice
    columns: slice
    shape: tuple[int, int]
    size: int
    """Counts."""
    n_bytes: int
    """Of the frame's data, with header and padding."""
    padding: bytes


class StreamFrames:
    """The frames of one direction, for blocks of one size: `rig.wire.can.definition.Shape` worked out.

    Whole blocks go into the sequence numbers, so that a loss of a whole wrap cannot make one block of the frames of two.
    """

    def __init__(self, protocol: Protocol, kind: FrameKind, block: int) -> None:
        shape, outputs = protocol.shape, kind is FrameKind.OUTPUT
        self.fd, self.header = shape.fd, shape.header
        self.block = block
        self.n_channels = 1 if outputs else shape.n_channels
        self.rows = shape.output_rows if outputs else shape.rows
        """Rows of a group; the last one of a block may have fewer."""
        self.parts = 1 if outputs else shape.parts
        """Frames of a group."""
        self.groups = -(-block // self.rows)
        """Groups of a block."""
        wrap = shape.output_wrap if outputs else shape.wrap
        self.wrap = wrap - wrap % self.groups
        """Sequence numbers."""
        columns = (slice(0, 1),) if outputs else tuple(shape.columns(part) for part in range(self.parts))
        self.pieces = tuple(
            tuple(self._piece(group * self.rows, part) for part in columns) for group in range(self.groups)
        )
        """By group within the block, and part."""
        numbers = self.parts if self.fd else self.wrap * self.parts
        self._identifiers = tuple(protocol.identifiers[kind, number] for number in range(numbers))

    def _piece(self, first: int, columns: slice) -> Piece:
        rows = min(self.rows, self.block - first)
        size = rows * (columns.stop - columns.start)
        used = self.header + 2 * size
        n_bytes = padded_length(used) if self.fd else used
        shape = rows, columns.stop - columns.start
        return Piece(slice(first, first + rows), columns, shape, size, n_bytes, bytes(n_bytes - used))

    def sequence_of(self, first: int) -> int:
        """The sequence number with which the block from sample ``first`` on begins."""
        return first // self.block * self.groups % self.wrap

    def frames(self, first: int, counts: np.ndarray, flags: int) -> list[Frame]:
        """The frames of a block: counts int16 [n, n_channels], or [n] for outputs."""
        counts = counts.astype(COUNT, copy=False)
        sequence, out, parts = self.sequence_of(first), [], self.parts
        for pieces in self.pieces:
            for part, piece in enumerate(pieces):
                data = (counts[piece.rows] if parts == 1 else counts[piece.rows, piece.columns]).tobytes()
                if self.fd:
                    data = b"%c%c%b%b" % (sequence, flags & 0xFF, data, piece.padding)
                    out.append(Frame(self._identifiers[part], data, True))
                else:
                    out.append(Frame(self._identifiers[sequence * parts + part], data))
            sequence += 1  # within a block it never comes to the wrap
        return out
