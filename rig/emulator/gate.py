"""The gate before a device's converter: closed until it is armed, closed again at once or down a ramp."""

import math

import numpy as np

__all__ = ["Gate"]


class Gate:
    """Which part of the outputs gets through, by the index of the sample; instants between two samples are fractions."""

    def __init__(self) -> None:
        self._opens = math.inf
        self._closes = math.inf
        self._ramp_samples = 0.0

    def open(self, first: int) -> None:
        """Let outputs through from a sample on."""
        self._opens, self._closes = first, math.inf

    def close(self, instant: float, ramp_samples: float = 0.0) -> None:
        """0 V from an instant on, or from the end of the ramp that begins there."""
        self._closes, self._ramp_samples = instant, ramp_samples

    def is_closing(self, first: int) -> bool:
        """Whether it was closed and a ramp may still be under way at a sample."""
        return first < self._closes + self._ramp_samples and self._closes < math.inf

    def let_through(self, first: int, volts: np.ndarray) -> np.ndarray:
        """What is left of the outputs [n] of a block."""
        if first < self._opens:
            volts[: int(min(volts.size, self._opens - first))] = 0.0
        if first + volts.size > self._closes:
            beyond = np.arange(first, first + volts.size) - self._closes
            if self._ramp_samples == 0.0:
                volts[beyond >= 0.0] = 0.0
            else:
                volts *= np.clip(1.0 - beyond / self._ramp_samples, 0.0, 1.0)
        return volts
