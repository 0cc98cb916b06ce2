"""A line for who waits while kernels are compiled, on a terminal."""

import sys
import time

from vibrolock.compiling import on_compiling

FEW = 5  # kernels that are compiled without a word
EVERY_S = 5.0  # s between two lines on the terminal; chosen


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
        so_far = f" ({self.count} kernels so far)" if self.count > FEW else ""
        print(f"compiling, once; some fifteen seconds of one core{so_far}", file=sys.stderr, flush=True)


def say_what_is_compiled() -> None:
    """Say on a terminal that kernels are compiled, for it takes a while and happens in the middle of something else."""
    if sys.stderr is not None and sys.stderr.isatty():
        on_compiling.append(_Lines())
