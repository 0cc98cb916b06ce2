"""Reading of a user's files without blocking: a regular file of bounded size, or an error that names the file."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from rig.errors import ConfigurationError, RigError

_AT_ONCE = getattr(os, "O_NONBLOCK", 0)  # opening a FIFO that nobody writes to would wait for ever
_KINDS = {stat.S_IFDIR: "folder", stat.S_IFIFO: "FIFO", stat.S_IFCHR: "device", stat.S_IFBLK: "device"}
_RAW = getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)


@contextmanager
def open_regular(path: Path, largest_bytes: int, error: type[RigError] = ConfigurationError) -> Iterator[BinaryIO]:
    """Open a regular file; raise ``error`` for another kind, more than ``largest_bytes``, or a failure."""
    try:
        descriptor = os.open(path, os.O_RDONLY | _AT_ONCE | _RAW)
        with os.fdopen(descriptor, "rb", closefd=True) as stream:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                named = _KINDS.get(stat.S_IFMT(status.st_mode), "special file")
                raise error(f"{path}: is a {named}, allowed is a regular file")
            if status.st_size > largest_bytes:
                raise error(f"{path}: has {status.st_size} bytes, allowed are up to {largest_bytes}")
            yield stream
    except FileNotFoundError:
        raise error(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise error(f"{path}: is a folder, allowed is a regular file") from None
    except PermissionError:
        raise error(f"{path}: may not be read (permission denied)") from None
    except OSError as failure:
        raise error(f"{path}: cannot be read ({failure.strerror})") from None


def read_bytes(path: Path, largest_bytes: int, error: type[RigError] = ConfigurationError) -> bytes:
    """Return the content of a regular file; raise ``error`` for another kind, more than ``largest_bytes``, or a failure."""
    try:
        with open_regular(path, largest_bytes, error) as stream:
            read = stream.read(largest_bytes + 1)
    except ValueError as failure:  # a NUL in its name
        raise error(f"{str(path)!r}: is not the name of a file ({failure})") from None
    if len(read) > largest_bytes:  # it grew
        raise error(f"{path}: has {len(read)} bytes, allowed are up to {largest_bytes}")
    return read


def read_text(
    path: Path, largest_bytes: int, error: type[RigError] = ConfigurationError, encoding: str = "utf-8-sig"
) -> str:
    """Return the content of a regular file as text; raise as `read_bytes`, and if the encoding is wrong."""
    try:
        return read_bytes(path, largest_bytes, error).decode(encoding)
    except UnicodeDecodeError as failure:
        raise error(
            f"{path}: is not {encoding.removesuffix('-sig').upper()} text (byte {failure.start}: {failure.reason})"
        ) from None
