"""Signals of the operating system while a rig is driven: they ask for a ramp-down, and end nothing."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["stop_on_signals"]


@contextmanager
def stop_on_signals(request_stop: Callable[[str], None]) -> Iterator[None]:
    """While the rig is driven, Ctrl-C, SIGTERM, a closed terminal and SIGQUIT ask for a ramp-down, and end nothing.

    ``request_stop`` is given a sentence with the signal's name. Without effect outside the main
    thread, where Python delivers no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(number: int, frame: FrameType | None) -> None:
        request_stop(f"stopped by request ({signal.Signals(number).name})")

    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")  # the last two not on every system
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.signal(number, ask) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
