"""Says on standard error what goes on while a command is silent: plain lines with the time, on a terminal and in a pipe."""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import ClassVar, Self

from vibrolock.printable import printable

FIRST_S = 1.0  # silence after which it is said what is being done; chosen: with the start of Python, before two seconds
FURTHER_S = 15.0  # silence after which it is said again; chosen


class _Silence:
    """When something was said last, and whether nothing may be said, for a person is typing."""

    since_s = 0.0
    wanted = 0
    waiting: ClassVar[list["Waiting"]] = []
    """Those that wait: the last one, which is the most exact, speaks."""


def heard() -> None:
    """Note that something was shown, so that there is no silence to break."""
    _Silence.since_s = time.monotonic()


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Say nothing meanwhile, for a person is asked something."""
    _Silence.wanted += 1
    try:
        yield
    finally:
        _Silence.wanted -= 1
        heard()


def say_beside(text: str) -> bool:
    """Say something else about a slow command, with its time, and return True; do nothing if it is quick so far."""
    return bool(_Silence.waiting) and not _Silence.wanted and _Silence.waiting[0].beside(text)


class Waiting:
    """Says what a command does: after a moment, or at once if ``announced``; again after each further silence.

    ``usual``: how long it takes, in words, or a function that says it when it is asked; it is said with the first line. If
    several wait, one inside the other, the innermost speaks.
    """

    def __init__(self, what: str, usual: str | Callable[[], str] = "", *, announced: bool = False) -> None:
        self._what, self._usual, self._announced = what, usual, announced
        self._spoken = False
        self._began_s = time.monotonic()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="waiting", daemon=True)

    def __enter__(self) -> Self:
        if not _Silence.waiting:
            heard()
        _Silence.waiting.append(self)
        if self._announced:
            self._say()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()
        _Silence.waiting.remove(self)

    def now(self, what: str, usual: str = "") -> None:
        """Say what is done from now on."""
        self._what, self._usual = what, usual
        self._say()

    def beside(self, text: str) -> bool:
        """Say ``text`` and return True, unless the command is quick so far."""
        if time.monotonic() - self._began_s < FIRST_S:
            return False
        self._print(text)
        return True

    def _watch(self) -> None:
        while not self._over.wait(0.1):
            silent_s = time.monotonic() - _Silence.since_s
            longest_s = FURTHER_S if self._spoken else FIRST_S
            if not _Silence.wanted and _Silence.waiting[-1:] == [self] and silent_s >= longest_s:
                self._say()

    def _say(self) -> None:
        for one in _Silence.waiting:
            one._spoken = True
        usual, self._usual = self._usual, ""
        said = usual() if callable(usual) else usual
        self._print(f"{self._what}, {said}" if said else self._what)

    def _print(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            clear = "\r\x1b[2K" if sys.stderr.isatty() else ""
            line = printable(f"[{time.monotonic() - self._began_s:.0f} s] {text}")
            print(f"{clear}{line}", file=sys.stderr, flush=True)
        heard()
