"""The digest at the end of every HDF5 file of ours: 52 bytes behind what HDF5 reads, which it ignores.

It tells a file with a changed byte from one without before HDF5 reads any of it. It is no signature: who can write the
file can write its digest.
"""

import hashlib
import io
import os
import struct
from pathlib import Path
from typing import BinaryIO

from rig.errors import RecordingError

__all__ = ["append_trailer", "digest_matches"]

_MAGIC, _VERSION = b"VLDIGEST", 1
_TRAILER = struct.Struct("<8sI32sQ")
_AT_ONCE = 2**20


def append_trailer(stream: "BinaryIO | io.RawIOBase") -> None:
    """Write the digest of all there is in ``stream`` behind it."""
    covered = stream.seek(0, os.SEEK_END)
    digest = _digest(stream, covered)
    stream.seek(covered)
    stream.write(_TRAILER.pack(_MAGIC, _VERSION, digest, covered))


def digest_matches(path: Path) -> bool:
    """Read ``path`` once, 1 MiB at a time: True where it is as it was written, False where it has no digest.

    Raises:
        RecordingError: the digest does not match what is before it.
        OSError: it cannot be read.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        start = size - _TRAILER.size
        if start < 0:
            return False
        stream.seek(start)
        magic, version, digest, covered = _TRAILER.unpack(stream.read(_TRAILER.size))
        if (
            magic != _MAGIC and covered != start
        ):  # either is enough, so that a changed byte in one does not hide the other
            return False
        if (magic, version, covered) == (_MAGIC, _VERSION, start) and _digest(stream, covered) == digest:
            return True
    raise RecordingError(f"{path}: damaged: its digest does not match (a byte has changed since it was written)")


def _digest(stream: "BinaryIO | io.RawIOBase", length: int) -> bytes:
    digest = hashlib.sha256()
    stream.seek(0)
    while length > 0 and (data := stream.read(min(_AT_ONCE, length))):
        digest.update(data)
        length -= len(data)
    return digest.digest()
