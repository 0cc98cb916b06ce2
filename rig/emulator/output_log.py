"""What a device puts out, written down: so that somebody else can see when it came to 0 V."""

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from rig.emulator.plant import Plant
from rig.errors import ConfigurationError

__all__ = ["LoggedPlant"]


class LoggedPlant:
    """A plant that writes one line a block: time of ``time.monotonic`` in s, first sample, largest absolute output in V.

    One with 0 V more says that the device was stopped and put out nothing any more.

    A file that cannot be made is a `ConfigurationError`; a disk that is full later ends the writing and nothing else.
    """

    def __init__(self, plant: Plant, path: Path) -> None:
        self._plant = plant
        try:
            self._descriptor = os.open(
                path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644
            )  # for as long as the device lives
        except OSError as error:
            raise ConfigurationError(f"log_output = {str(path)!r}: cannot be written: {error.strerror}") from error
        self._is_full = False
        self._first = 0

    names: tuple[str, ...]
    range_v: np.ndarray
    v_per_count: np.ndarray
    skew_s: np.ndarray
    output_range_v: float
    output_v_per_count: float
    bits: int
    rate_hz: float
    filter_delay_s: float

    def __getattr__(self, name: str) -> Any:
        """Everything else is the plant's."""
        return getattr(self._plant, name)

    def reset(self) -> None:
        """Sample 0, and 0 V on the converter."""
        self._plant.reset()
        self._first = 0
        self._write(0.0)

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        """Write down, then measure."""
        self._write(float(np.abs(voltages).max()))
        self._first += voltages.size
        return self._plant.step(voltages)

    def _write(self, largest_v: float) -> None:
        if self._is_full:
            return
        try:
            os.write(self._descriptor, f"{time.monotonic():.6f} {self._first} {largest_v:.6g}\n".encode("ascii"))
        except OSError:
            self._is_full = True
