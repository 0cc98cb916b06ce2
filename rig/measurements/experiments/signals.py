"""Which recorded signals an experiment holds, in which order, without the channels' skew and sensors' offsets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import Channel, IdentificationError
from rig.bench import Bench
from rig.campaigns.evaluation.vibrations import VOLTAGE, channels_of

__all__ = ["SKEW_EDGE", "Signals"]

SKEW_EDGE = 32
"""Samples at either end of a record that feel its ends once a fraction of a sample is taken out, beside the skew itself."""
_KAISER_BETA = 8.6
_HELD_AT_ZERO = ("velocity", "acceleration")


@dataclass(frozen=True)
class Signals:
    """The signals chosen of a bench: every input channel in its order, then the output ``voltage``."""

    bench: Bench
    """The bench as it was."""
    inputs: tuple[int, ...]
    """Rows that go into a model."""
    outputs: tuple[int, ...]
    """Rows that come out of it."""

    @classmethod
    def chosen(cls, bench: Bench, inputs: Sequence[str], outputs: Sequence[str] | None) -> "Signals":
        """By name, or by role; ``outputs`` None: all motions, and the force unless it is an input.

        Raises `IdentificationError` for a name that is not there, none at all, and one on both sides.
        """
        channels = (*channels_of(bench), VOLTAGE)
        into = _rows(channels, "inputs", inputs)
        if outputs is None:
            motions = [row for row, channel in enumerate(channels) if channel.role in ("drive", "response")]
            forces = [row for row, channel in enumerate(channels) if channel.role == "force" and row not in into]
            out = tuple(row for row in (*forces, *motions) if row not in into)
        else:
            out = _rows(channels, "outputs", outputs)
        if both := [channels[row].name for row in out if row in into]:
            raise IdentificationError(f"outputs: {both[0]} is an input already")
        return cls(bench, into, out)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All of them."""
        return (*channels_of(self.bench), VOLTAGE)

    @property
    def input_channels(self) -> tuple[Channel, ...]:
        """What goes in."""
        return tuple(self.channels[row] for row in self.inputs)

    @property
    def output_channels(self) -> tuple[Channel, ...]:
        """What comes out."""
        return tuple(self.channels[row] for row in self.outputs)

    def of(self, rows: np.ndarray) -> np.ndarray:
        """float[n_channels + 1, n]: recorded rows as they are."""
        return np.vstack([rows["inputs"].T.astype(float), rows["output_v"].astype(float)])

    @property
    def offset(self) -> np.ndarray:
        """bool[n_channels + 1]: channels whose mean over a vibration is the sensor's, for no motion goes on and on."""
        return np.array([c.role in ("drive", "response") and c.motion in _HELD_AT_ZERO for c in self.channels])

    @property
    def skew(self) -> np.ndarray:
        """float[n_channels + 1]: samples by which each lags."""
        return np.array([*(channel.skew_samples for channel in self.bench.channels), 0.0])

    def in_step(self, signals: np.ndarray) -> tuple[np.ndarray, int]:
        """The signals with every channel moved forward by its skew, and how many samples at either end are spoilt by it."""
        skew = self.skew
        if not skew.any():
            return signals, 0
        moved = np.array([_advanced(row, samples) for row, samples in zip(signals, skew, strict=True)])
        return moved, SKEW_EDGE + int(np.ceil(np.abs(skew).max()))


def _rows(channels: tuple[Channel, ...], what: str, wanted: Sequence[str]) -> tuple[int, ...]:
    """Rows of channels by name, or by role where no channel has that name."""
    found: list[int] = []
    for name in (wanted,) if isinstance(wanted, str) else wanted:
        rows = [row for row, channel in enumerate(channels) if channel.name == name]
        rows = rows or [row for row, channel in enumerate(channels) if channel.role == name]
        if not rows:
            names = ", ".join(channel.name for channel in channels)
            raise IdentificationError(f"{what}: there is no channel {name}; channels are {names}")
        found += [row for row in rows if row not in found]
    if not found:
        raise IdentificationError(f"{what}: none given, needs one channel at least")
    return tuple(found)


def _advanced(signal: np.ndarray, samples: float) -> np.ndarray:
    """A signal ``samples`` later: whole samples by shifting, the rest by a windowed sinc; zero beyond its ends."""
    if samples == 0.0:
        return signal
    whole = int(np.round(samples))
    at = np.arange(-SKEW_EDGE, SKEW_EDGE + 1)
    window = np.kaiser(at.size, _KAISER_BETA)
    kernel = np.sinc(at + (samples - whole)) * window
    padded = np.pad(signal, SKEW_EDGE + abs(whole))
    moved = np.convolve(padded, kernel / kernel.sum(), mode="same")
    start = SKEW_EDGE + abs(whole) + whole
    return np.asarray(moved[start : start + signal.size])
