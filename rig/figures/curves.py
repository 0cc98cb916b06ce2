"""What curves of several files laid over one another are made of, and how one wants to see them."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification import Channel
from rig.errors import RecordingError
from vibrolock.arrays import Float

_DERIVATIVE = {"m": 0, "m/s": 1, "m/s2": 2, "m/s^2": 2}
"""Which derivative of the displacement a channel measures, by its unit."""


@dataclass(frozen=True)
class View:
    """How curves are shown. Fields that make no sense for the files at hand are refused in one line."""

    amplitude: str | None = None
    """Axis of amplitudes: ``linear``, ``log`` or ``dB`` (from one SI unit); None: what is usual for the kind."""
    channel: str = ""
    """Name of the channel that is shown; empty: the drive point."""
    harmonic: int = 1
    """Harmonic of the channel that is shown; 1 is the fundamental."""
    frequency_hz: tuple[float, float] | None = None
    """Lower and upper end of the frequency axis, Hz."""

    def __post_init__(self) -> None:
        if self.amplitude not in (None, "linear", "log", "dB"):
            raise RecordingError(f"`amplitude` {self.amplitude}: allowed are linear, log, dB")
        if self.frequency_hz is not None and not 0.0 <= self.frequency_hz[0] < self.frequency_hz[1] < np.inf:
            low, high = self.frequency_hz
            raise RecordingError(f"`frequency` {low:g}:{high:g}: must rise, from 0 or above")

    def only(self, *names: str, of: str) -> None:
        """Raise `RecordingError` if another field than the named ones (or ``frequency_hz``, ``amplitude``) is set."""
        given = {"channel": self.channel != "", "harmonic": self.harmonic != 1}
        for name, is_set in given.items():
            if is_set and name not in names:
                raise RecordingError(f"`{name}` {getattr(self, name)}: {of}")


class Quantity(NamedTuple):
    """What is drawn along an axis."""

    text: str
    """Name at the axis."""
    unit: str
    """Unit of the values; m is shown as mm or µm."""
    role: Literal["amplitude", "frequency", ""] = ""
    """What a `View` does to the axis."""


class Panel(NamedTuple):
    """Axes of one panel."""

    x: Quantity
    y: Quantity
    log: bool = False
    """Whether the axis of amplitudes is logarithmic unless a `View` says otherwise."""


class Line(NamedTuple):
    """One curve in one panel."""

    x: Float
    """float[n], NaN where the curve is interrupted."""
    y: Float
    """float[n]."""
    half_95: Float | None = None
    """float[n]: half of the 95 % interval of ``y``; None if unknown."""
    folded: NDArray[np.bool_] | None = None
    """bool[n]: points of a branch that is unstable at constant force; None where this is not known."""


class Trace(NamedTuple):
    """The curves of one level or pass, one for each panel."""

    level: str
    """Name of the level or pass; empty if the file has one only."""
    lines: tuple[Line, ...]
    """One for each panel."""


@dataclass(frozen=True)
class Curves:
    """All curves of one file."""

    panels: tuple[Panel, ...]
    """The panels."""
    traces: tuple[Trace, ...]
    """The curves."""
    specimen: str
    """Name of what was tested."""
    omitted: str = ""
    """What is in the file and not drawn, with the reason; empty if nothing is."""


def channel_of(channels: tuple[Channel, ...], view: View) -> int:
    """Return the row of the view's channel, by default the drive point; raise `RecordingError` if there is none."""
    names = [channel.name for channel in channels]
    if view.channel and view.channel not in names:
        raise RecordingError(f"`channel` {view.channel}: there are {', '.join(names)}")
    return names.index(view.channel) if view.channel else [channel.role for channel in channels].index("drive")


def peak(
    channels: tuple[Channel, ...], harmonics: NDArray[np.complex128], frequency_hz: Float, view: View
) -> tuple[Quantity, Float]:
    """Return what the amplitudes of the view's channel and harmonic are, and their values, float[n].

    ``harmonics`` are complex[n, n_channels, H + 1] in the units of the channels. Motions become displacements.
    Raises `RecordingError` if the channel or the harmonic was not recorded.
    """
    row = channel_of(channels, view)
    if not 1 <= view.harmonic < harmonics.shape[2]:
        raise RecordingError(f"`harmonic` {view.harmonic}: recorded are 1 to {harmonics.shape[2] - 1}")
    channel, values = channels[row], np.abs(harmonics[:, row, view.harmonic])
    of = f" at {channel.name}" if view.channel else ""
    which = f", harmonic {view.harmonic}" if view.harmonic > 1 else ""
    if channel.unit in _DERIVATIVE:
        values = values / (2.0 * np.pi * view.harmonic * frequency_hz) ** _DERIVATIVE[channel.unit]
        return Quantity(f"displacement amplitude{of}{which}", "m", "amplitude"), values
    return Quantity(f"amplitude of {channel.name}{which}", channel.unit, "amplitude"), values
