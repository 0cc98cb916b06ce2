"""Check whether a file is as it was written, by the digest at its end; files without one are first read in a child process."""

import hashlib
import io
import json
import os
import struct
import time
from pathlib import Path
from typing import BinaryIO

from rig.errors import RecordingError
from rig.system.child import MEMORY_BYTES, ChildFailed, ask_child

_MAGIC, _VERSION = b"VLDIGEST", 1  # first bytes of the trailer, and version of its layout
_TRAILER = struct.Struct("<8sI32sQ")
_AT_ONCE = 2**20  # bytes that are digested at a time; chosen


def append_trailer(stream: "BinaryIO | io.RawIOBase") -> None:
    """Append the digest of everything in ``stream``."""
    covered = stream.seek(0, os.SEEK_END)
    digest = _digest(stream, covered)
    stream.seek(covered)
    stream.write(_TRAILER.pack(_MAGIC, _VERSION, digest, covered))


def digest_matches(path: Path) -> bool:
    """Read ``path`` once, 1 MiB at a time; return True if it is as it was written, False if it has no digest.

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


VERIFIED = "verified"
FIRST_WITH_DIGEST = 3
"""Schema from which on every HDF5 file has a digest."""

_TIMEOUT_S, _SLOWEST_BYTES_S = 60.0, 5e6  # of the child: s, and bytes/s of the slowest disk; chosen
_SETTLED_S = 2.0  # after the last change: longer than a tick of any file system (2 s on FAT)

_known: dict[tuple[Path, int, int, int, int, int], str] = {}
"""Results by path, device, inode, size and times of a file."""


def integrity_of(path: Path) -> str:
    """Return ``"verified"`` if the digest matches, else ``"unverified: WHY"``: the file is readable, but may have been changed.

    A file without a digest is first read completely by a child process, within 60 s plus 1 s per 5 MB and 4 GiB. A file that
    crashes the HDF5 library then only crashes the child.

    Raises:
        RecordingError: the digest does not match, or the file cannot be read from beginning to end.
        OSError: there is no such file, or it may not be read.
    """
    facts = path.stat()
    state = (path.absolute(), facts.st_dev, facts.st_ino, facts.st_size, facts.st_mtime_ns, facts.st_ctime_ns)
    if state not in _known:
        # A change within one tick of the file system's clock does not show in its times: for new files the result is not kept.
        settled = time.time() - max(facts.st_mtime, facts.st_ctime) > _SETTLED_S
        found = VERIFIED if digest_matches(path) else _read_by_child(path, facts.st_size)
        if not settled:
            return found
        _known[state] = found
    return _known[state]


def _read_by_child(path: Path, size: int) -> str:
    try:
        answer = json.loads(
            ask_child("rig.recording.whole_read", str(path), timeout_s=_TIMEOUT_S + size / _SLOWEST_BYTES_S)
        )
    except ChildFailed as error:
        raise RecordingError(f"{path}: damaged: the HDF5 library {error} over it") from error
    if answer["memory"]:
        raise RecordingError(f"{path}: damaged: reading it takes more than {MEMORY_BYTES / 2**30:g} GiB of memory")
    if answer["refused"]:
        raise RecordingError(answer["refused"])
    if answer["schema"] < FIRST_WITH_DIGEST:
        return f"unverified: written by schema {answer['schema']}, which has no digest"
    return "unverified: its digest is gone; another program has changed or rewritten it, or cut off its end"
