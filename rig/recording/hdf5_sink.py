"""The file that HDF5 writes into, safe on a full disk.

HDF5 does not survive a failing write: it cannot close the file any more, and ends the whole process by a segmentation
fault on the way out. So a failed write is not reported to it. This sink notes the error and holds further writes in
memory; the writer asks ``check`` after every chunk, stops at the first error, and what HDF5 flushes on closing is lost
with the unfinished file.
"""

import io
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


class Sink(io.RawIOBase):
    """A new file at ``path``, where nothing may be; opened and closed as any file object.

    Raises:
        OSError: on construction, where it cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("x+b", buffering=0)
        self._position = 0
        self._held: list[tuple[int, bytes]] = []
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the ``OSError`` of the first failed write, if any failed."""
        if self._error is not None:
            raise OSError(self._error.errno, self._error.strerror) from self._error

    def fileno(self) -> int:
        """Descriptor of the file."""
        return self._file.fileno()

    def close(self) -> None:
        """Close the file; data held in memory are dropped."""
        self._file.close()
        super().close()

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to ``offset``; the end counts what was written and what is held in memory."""
        if whence == io.SEEK_END:
            offset += max([self._file.seek(0, io.SEEK_END), *(start + len(data) for start, data in self._held)])
        elif whence == io.SEEK_CUR:
            offset += self._position
        self._position = offset
        return offset

    def tell(self) -> int:
        """Return the position."""
        return self._position

    def write(self, data: "ReadableBuffer") -> int:
        """Write all of ``data``; never fails."""
        view = memoryview(data).cast("B")
        if self._error is None:
            try:
                self._file.seek(self._position)
                rest = view
                while rest:
                    rest = rest[self._file.write(rest) :]
            except OSError as error:
                self._error = error
        if self._error is not None:
            self._held.append((self._position, bytes(view)))
        self._position += len(view)
        return len(view)

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Fill ``buffer`` from the file and from bytes not yet written to it. Bytes that never existed read as zeros."""
        view = memoryview(buffer).cast("B")
        self._file.seek(self._position)
        data = self._file.read(len(view)).ljust(len(view), b"\0")
        view[:] = data
        for start, held in self._held:
            first, last = max(start, self._position), min(start + len(held), self._position + len(view))
            if first < last:
                view[first - self._position : last - self._position] = held[first - start : last - start]
        self._position += len(view)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file; after an error do nothing."""
        size = self._position if size is None else size
        if self._error is None:
            try:
                self._file.truncate(size)
            except OSError as error:
                self._error = error
        return size

    def readable(self) -> bool:
        """Return True: it can be read, written and moved in."""
        return True

    writable = seekable = readable
