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
        self._fit = 0
        self._began_s = time.perf_counter()
        self._stage, self._iteration, self._seen = "", 0, 0

    def begin_fit(self) -> None:
        """Note that a fit begins."""
        self._fit += 1

    def begin(self, stage: str) -> None:
        """Note that a stage begins."""
        least, most = self._fits
        fit = f"fit {self._fit} of {least} to {most}, " if most > 1 else ""
        self._stage, self._iteration = fit + stage, 0

    def linearised(self, error: float, took_s: float) -> None:
        """Note a linearisation: the relative error before it, and how long it took."""
        self._seen += 1
        if self._progress is not None:
            timed = self._seen == _FIRST_LINEARISATIONS
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
