"""A request to stop, left for a run by another process of the same user, and the thread of the run that looks for it.

The request is a file in the run's folder: it needs no socket, no page and no script, and it stays until the run has ended, for
further parts of it as well.
"""

import os
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rig.errors import RecordingError
from rig.live.place import STOP
from vibrolock.printable import printable

POLL_S = 0.05  # s between two looks for a request; chosen: twenty times a second
LARGEST_CAUSE_BYTES = 300  # of a cause; chosen: a line


def request_stop(folder: Path, cause: str) -> None:
    """Ask the run with this folder to ramp down; ``cause`` says who asks, in one line. A first request is kept.

    Raises:
        RecordingError: the request cannot be left, because the run has ended or the memory is full.
    """
    path, written = folder / STOP, folder / f".{STOP}-{secrets.token_hex(8)}"
    try:
        descriptor = os.open(written, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with suppress(OSError):  # an empty file is a request as well
            os.write(descriptor, cause.encode()[:LARGEST_CAUSE_BYTES])
        os.close(descriptor)
        with suppress(FileExistsError):
            os.link(written, path)  # it appears with its text
        written.unlink()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written ({error.strerror}); use the hardware stop") from error


@contextmanager
def stopping_on_request(folder: Path, stop: Callable[[str], None]) -> Iterator[None]:
    """Look for a request while the rig is driven, in a thread of its own; ``stop`` gets its cause, once.

    One that was left before is heeded before anything else is done.
    """
    path, over = folder / STOP, threading.Event()
    if path.exists():
        stop(_cause(path))
        over.set()

    def look() -> None:
        while not over.wait(POLL_S):
            if path.exists():
                stop(_cause(path))
                return

    watch = threading.Thread(target=look, name="requests to stop", daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        watch.join()


def _cause(path: Path) -> str:
    try:
        text = path.read_bytes()[:LARGEST_CAUSE_BYTES].decode(errors="replace")
    except OSError:
        text = ""
    return printable(text.strip()) or "stopped by request"
