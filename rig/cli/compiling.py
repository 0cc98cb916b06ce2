"""A line for who waits while kernels are compiled."""

import contextlib
import time
from collections.abc import Iterator

from rig.show.waiting import say_beside
from vibrolock.compiling import on_compiling

FEW = 5  # kernels that are compiled without a word
EVERY_S = 5.0  # s between two lines; chosen


class _Lines:
    """Says that kernels are compiled, and every few seconds how many were."""

    def __init__(self) -> None:
        self.count = 0
        self.due_s = 0.0

    def __call__(self, name: str) -> None:
        self.count += 1
        if self.count < FEW or time.monotonic() < self.due_s:
            return
        self.due_s = time.monotonic() + EVERY_S
        so_far = f" ({self.count} functions so far)" if self.count > FEW else ""
        say_beside(f"compiling for this computer, only this time: some 15 s to a minute{so_far}")


@contextlib.contextmanager
def compiling_is_said() -> Iterator[None]:
    """Say that kernels are compiled, for it takes a while and happens in the middle of something else."""
    lines = _Lines()
    on_compiling.append(lines)
    try:
        yield
    finally:
        on_compiling.remove(lines)
