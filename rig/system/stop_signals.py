"""Signals of the operating system while a run is under way: Ctrl-C, SIGTERM, a closed terminal (SIGHUP) and SIGQUIT.

A rig that is driven ramps down (`asking`). While nothing is driven, and files are made or put in their places, a signal ends
the program by an exception, so that what is half-made is taken away (`ended_in_order`); where an exception could do harm, or
get lost in a library, it is raised afterwards (`held`).

Outside the main thread, where Python delivers no signals, nothing of this has an effect. A closed terminal that was to be
ignored when the program was started (``nohup``) stays ignored.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

__all__ = ["Held", "Interrupted", "Terminated", "asking", "ended_in_order", "held", "ignore_from_now_on", "insisting"]

_ENDING = ("SIGTERM", "SIGHUP", "SIGQUIT")  # the last two not on every system
_Handler = Callable[[int, FrameType | None], None]


class Interrupted(KeyboardInterrupt):
    """Ctrl-C; ``recorded`` names the recording that was whole when it came."""

    recorded: Path | None = None


class Terminated(SystemExit):
    """Another signal than Ctrl-C; ends the program with the status that shells give it, 128 and its number."""

    recorded: Path | None = None

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.signal = signal.Signals(number).name


def _raised(number: int) -> Interrupted | Terminated:
    return Interrupted() if number == signal.SIGINT else Terminated(number)


def _by_nohup(number: int) -> bool:
    """Whether a closed terminal was to be ignored already. A shell's ``&`` ignores Ctrl-C, but ``kill -INT`` is meant."""
    return signal.Signals(number).name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN


@contextmanager
def _handling(handler: _Handler, names: tuple[str, ...]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    heeded = [number for number in numbers if not _by_nohup(number)]
    before = {number: signal.signal(number, handler) for number in heeded}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextmanager
def asking(request_stop: Callable[[str], None]) -> Iterator[None]:
    """While the rig is driven, signals ask for a ramp-down and end nothing; ``request_stop`` is told which."""

    def ask(number: int, frame: FrameType | None) -> None:
        request_stop(f"stopped by request ({signal.Signals(number).name})")

    with _handling(ask, ("SIGINT", *_ENDING)):
        yield


@contextmanager
def ended_in_order() -> Iterator[None]:
    """Let other signals than Ctrl-C, which does so already, end the program by an exception (`Terminated`)."""

    def end(number: int, frame: FrameType | None) -> None:
        raise _raised(number)

    with _handling(end, _ENDING):
        yield


class Held:
    """A signal that has come and perhaps was not acted on."""

    def __init__(self) -> None:
        self.number: int | None = None

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        self.number = number

    def check(self, recorded: Path | None = None) -> None:
        """Raise what the signal that has come means, if one has; `Interrupted` or `Terminated`."""
        if self.number is not None:
            error = _raised(self.number)
            error.recorded = recorded
            self.number = None
            raise error


@contextmanager
def held() -> Iterator[Held]:
    """Act on no signal until ``check`` is called; one that comes after the last call is raised at the end."""
    signals = Held()
    with _handling(signals.note, ("SIGINT", *_ENDING)):
        yield signals
    signals.check()


@contextmanager
def insisting() -> Iterator[Held]:
    """Ctrl-C raises at once, and again at ``check`` where a library has swallowed the exception."""
    signals = Held()

    def insist(number: int, frame: FrameType | None) -> None:
        signals.note(number, frame)
        raise _raised(number)

    with _handling(insist, ("SIGINT",)):
        yield signals


def ignore_from_now_on() -> None:
    """Ignore other signals than Ctrl-C to the end of the program: all is done that can be done."""
    if threading.current_thread() is threading.main_thread():
        for name in _ENDING:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
