"""Signals of the operating system while a run is under way: Ctrl-C, SIGTERM, a closed terminal (SIGHUP) and SIGQUIT.

While the rig is driven, a signal makes it ramp down (`stopping_on_signals`). While nothing is driven and files are written, a
signal ends the program by an exception, so that incomplete files are removed (`ended_in_order`). Where an exception could do
harm, or get lost in a library, it is raised afterwards (`deferred`).

Outside the main thread, where Python delivers no signals, these functions have no effect. If the program was started to ignore
a closed terminal (``nohup``), the signal stays ignored.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

_ENDING = ("SIGTERM", "SIGHUP", "SIGQUIT")  # the last two not on every system
_Handler = Callable[[int, FrameType | None], None]


class Interrupted(KeyboardInterrupt):
    """Ctrl-C was pressed; ``recorded`` names the recording that was complete at that time."""

    recorded: Path | None = None


class Terminated(SystemExit):
    """Another signal than Ctrl-C arrived; the program ends with the usual shell status, 128 plus the signal's number."""

    recorded: Path | None = None

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.signal = signal.Signals(number).name


def _raised(number: int) -> Interrupted | Terminated:
    return Interrupted() if number == signal.SIGINT else Terminated(number)


@contextmanager
def _handling(handler: _Handler, names: tuple[str, ...]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {}
    for number in numbers:
        # A SIGHUP that was ignored at the start (nohup) stays so. SIGINT is not exempted: a shell's ``&`` ignores Ctrl-C, but
        # ``kill -INT`` shall still have an effect.
        if signal.Signals(number).name != "SIGHUP" or signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextmanager
def stopping_on_signals(request_stop: Callable[[str], None]) -> Iterator[None]:
    """Let signals only request a ramp-down while the rig is driven; ``request_stop`` gets a text naming the signal."""

    def ask(number: int, frame: FrameType | None) -> None:
        request_stop(f"stopped by request ({signal.Signals(number).name})")

    with _handling(ask, ("SIGINT", *_ENDING)):
        yield


@contextmanager
def ended_in_order() -> Iterator[None]:
    """Let signals other than Ctrl-C end the program by an exception (`Terminated`), as Ctrl-C does already."""

    def end(number: int, frame: FrameType | None) -> None:
        raise _raised(number)

    with _handling(end, _ENDING):
        yield


class DeferredSignals:
    """The last signal that arrived and may still have to be acted on."""

    def __init__(self) -> None:
        self.number: int | None = None

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        self.number = number

    def check(self, recorded: Path | None = None) -> None:
        """Raise `Interrupted` or `Terminated` if a signal has arrived."""
        if self.number is not None:
            error = _raised(self.number)
            error.recorded = recorded
            self.number = None
            raise error


@contextmanager
def deferred() -> Iterator[DeferredSignals]:
    """Act on no signal until ``check`` is called; a signal after the last call is raised when the context ends."""
    signals = DeferredSignals()
    with _handling(signals.note, ("SIGINT", *_ENDING)):
        yield signals
    signals.check()


@contextmanager
def escalating() -> Iterator[DeferredSignals]:
    """Let Ctrl-C raise at once, and again at ``check`` if a library has swallowed the exception."""
    signals = DeferredSignals()

    def insist(number: int, frame: FrameType | None) -> None:
        signals.note(number, frame)
        raise _raised(number)

    with _handling(insist, ("SIGINT",)):
        yield signals


def ignore_from_now_on() -> None:
    """Ignore signals other than Ctrl-C until the program ends, because all work is done."""
    if threading.current_thread() is threading.main_thread():
        for name in _ENDING:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
