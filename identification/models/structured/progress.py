"""Progress of a structured fit: its stage, iteration and error, and how long it will usually take."""

import math
import time
from collections.abc import Callable

from identification.fitting.result import FitProgress

_FIRST_LINEARISATIONS = 2
"""The first one also loads machine code, so the second one is timed."""
_LEAST, _MOST = 30.0, 120.0
"""Usual time of a fit of one element in times of such a linearisation: 40 to 100 were measured on the magnet beam."""


class FitWatch:
    """Calls ``progress`` after every linearisation of so many fits, least and most, ``iterations`` at most in a stage."""

    def __init__(self, progress: Callable[[FitProgress], None] | None, fits: tuple[int, int], iterations: int) -> None:
        self._progress, self._fits, self._iterations = progress, fits, iterations
        self._fit, self._what = 0, ""
        self._began_s = time.perf_counter()
        self._stage, self._iteration, self._seen, self._short = "", 0, 0, False

    def begin_fit(self, what: str = "") -> None:
        """Note that a fit begins, and of what."""
        self._fit, self._what = self._fit + 1, what

    def begin(self, stage: str, short: bool = False) -> None:
        """Note that a stage begins, or a short fit, whose time tells nothing of that of a whole one."""
        self._short = short
        least, most = self._fits
        fit = f"fit {self._fit} of {least} to {most}, " if most > 1 and self._fit else ""
        law = f"{self._what}, " if self._what else ""
        self._stage, self._iteration = fit + law + stage, 0

    def linearised(self, error: float, took_s: float) -> None:
        """Note a linearisation: the relative error before it, and how long it took."""
        self._seen += not self._short
        if self._progress is not None:
            timed = self._seen == _FIRST_LINEARISATIONS and not self._short
            self._progress(
                FitProgress(
                    iteration=self._iteration,
                    iterations=self._iterations,
                    training_error=error,
                    validation_error=math.nan,
                    damping=math.nan,
                    seconds=time.perf_counter() - self._began_s,
                    stage=self._stage,
                    usual_s=(_LEAST * self._fits[0] * took_s, _MOST * self._fits[1] * took_s) if timed else None,
                )
            )
        self._iteration += 1
