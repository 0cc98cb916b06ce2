"""Records that are read in chunks, so that an hour of many channels takes no more memory than a minute of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.validation import finite_array
from vibrolock.arrays import Bool, Float

CHUNK = 65536
"""Samples that are evaluated at once. Sums over a shorter record are those over the whole record, to the last bit."""

_TURN = 2.0 * np.pi
"""One turn, rad."""


class Record(Protocol):
    """A record of n samples in any store that yields stretches of it."""

    @property
    def size(self) -> int:
        """Number of samples."""

    def theta_rad(self, start: int, stop: int) -> Float:
        """float[stop - start]: phase of the oscillator, wrapped or not."""

    def samples(self, start: int, stop: int) -> tuple[Float, Bool]:
        """float[n_channels, stop - start] and bool[stop - start]: the signals, and which samples were lost."""


@dataclass(frozen=True, eq=False)
class ArrayRecord:
    """A record in memory: phase float[n], signals float[n_channels, n] and lost samples bool[n]."""

    theta: Float
    signals: Float
    lost: Bool

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.theta.size)

    def theta_rad(self, start: int, stop: int) -> Float:
        """Phase of a stretch."""
        return self.theta[start:stop]

    def samples(self, start: int, stop: int) -> tuple[Float, Bool]:
        """Signals and lost samples of a stretch."""
        return self.signals[:, start:stop], self.lost[start:stop]


def check_samples(samples: Float, channels: Sequence[Channel], size: int) -> None:
    """Raise `IdentificationError` unless ``samples`` has a row per channel and ``size`` columns."""
    if samples.shape != (len(channels), size):
        allowed = f"({len(channels)}, {size}): channels by samples of theta_rad"
        raise IdentificationError(f"shape {samples.shape}", field="samples", allowed=allowed)


def rising_steps(theta: Float, first: int = 0) -> Float:
    """float[n - 1]: steps of a phase from sample ``first`` on; raises `IdentificationError` unless it rises."""
    steps = np.diff(theta)
    if np.any(steps <= 0.0):
        where = first + int(np.argmax(steps <= 0.0))
        reason = f"does not rise from [{where}] to [{where + 1}], must rise with time"
        raise IdentificationError(reason, field="theta_rad")
    return steps


def unwrapped(theta_rad: Float) -> Float:
    """float[n]: ``np.unwrap(theta_rad)`` of a phase in float[n], in a third of its time."""
    theta = np.array(theta_rad)
    theta[1:] -= _TURN * np.cumsum(np.rint(np.diff(theta) / _TURN))
    return theta


def spans(size: int) -> Iterator[tuple[int, int]]:
    """Yield first sample and end of the chunks of a record."""
    for start in range(0, size, CHUNK):
        yield start, min(start + CHUNK, size)


class Phase:
    """Unwrapped phase of a record, read chunk by chunk.

    Raises `IdentificationError` on construction for fewer than two samples, or a phase that is not finite or does not rise.
    """

    def __init__(self, record: Record) -> None:
        if record.size < 2:
            raise IdentificationError(f"has {record.size} samples", field="theta_rad", allowed="one whole period")
        self._record = record
        self._only: Float | None = None
        """The phase of a record that is one chunk."""
        known = []
        last = 0.0
        for start, stop in spans(record.size):
            before = max(0, start - 1)  # with the last sample of the chunk before
            theta = self._unwrapped(before, stop)
            if start:
                theta += _whole_turns(last - theta[0])
            rising_steps(theta, before)
            if stop - start == record.size:
                self._only = theta
            known.append(theta[start - before])
            last = theta[-1]
        self._known = np.array(known)
        self.first, self.last = float(known[0]), float(last)

    def read(self, start: int, stop: int) -> Float:
        """float[stop - start]: phase of a stretch that begins with a chunk."""
        if self._only is not None:
            return self._only[start:stop]
        theta = self._unwrapped(start, stop)
        theta += _whole_turns(self._known[start // CHUNK] - theta[0])
        return theta

    def at(self, sample: int) -> float:
        """Phase at one sample."""
        start = sample - sample % CHUNK
        return float(self.read(start, sample + 1)[-1])

    def samples_below(self, turned_rad: float) -> int:
        """Number of samples at which the phase has turned by less than ``turned_rad`` since the first."""
        chunk = max(0, int(np.searchsorted(self._known - self.first, turned_rad)) - 1)
        start = chunk * CHUNK
        theta = self.read(start, min(start + CHUNK, self._record.size))
        return start + int(np.searchsorted(theta - self.first, turned_rad))

    def _unwrapped(self, start: int, stop: int) -> Float:
        theta = finite_array("theta_rad", self._record.theta_rad(start, stop), np.float64, 1)
        return unwrapped(theta)


def _whole_turns(rad: float) -> float:
    return float(_TURN * np.rint(rad / _TURN))


@dataclass(frozen=True)
class Line:
    """``np.linspace(first, last, size)``, read stretch by stretch."""

    first: float
    last: float
    size: int

    @property
    def step(self) -> float:
        """Difference between two neighbouring values."""
        return (self.last - self.first) / max(1, self.size - 1)

    def read(self, start: int, stop: int) -> Float:
        """float[stop - start]: values ``start`` to ``stop``."""
        values = np.arange(start, stop, dtype=np.float64)
        values *= self.step
        values += self.first
        if stop == self.size:
            values[-1] = self.last
        return values
