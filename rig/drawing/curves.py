"""What curves of several files laid over one another are made of, and how one wants to see them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification import Backbone, Channel, FrequencyResponseMatrix, NonlinearMode
from rig.drawing.style import unit_text
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


FREQUENCY = Quantity("frequency", "Hz", "frequency")
LAG = Quantity("phase lag of displacement", "deg")
FORCE = Quantity("fundamental force", "N", "amplitude")
DISPLACEMENT = Quantity("displacement amplitude", "m", "amplitude")
ONE_AMPLITUDE = "the file holds the fundamental of the drive point alone"
"""Why a `View` of another channel or harmonic is refused."""


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
    """bool[n]: points of a branch that is unstable at constant force or, of a model, unstable; None where this is not known."""


Origin = Literal["measured", "model", "reference"]
"""Where curves come from: a measurement; a model or its prediction; the measurement that a prediction holds beside it."""


class Trace(NamedTuple):
    """The curves of one level or pass, one for each panel."""

    level: str
    """Name of the level or pass; empty if the file has one only."""
    lines: tuple[Line, ...]
    """One for each panel."""
    origin: Origin = "measured"
    """Measurements are drawn as markers where there are models, which are lines."""
    notes: tuple[str, ...] = ()
    """Of each point what is told to who points at it; empty if nothing is known."""


@dataclass(frozen=True)
class Curves:
    """All curves of one file."""

    panels: tuple[Panel, ...]
    traces: tuple[Trace, ...]
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


def backbone_curves(
    modes: Sequence[tuple[Backbone | None, NonlinearMode]], view: View, omitted: str = "", notes: Sequence[str] = ()
) -> Curves:
    """Return modal frequency and damping over the amplitude, with 95 % intervals.

    ``modes`` come with the backbones that they were identified from where the file holds these; several are repeats. Without
    its backbone a mode is a model. ``notes`` are those of the points of a single mode.
    """
    traces, across = [], DISPLACEMENT
    for number, (measured, mode) in enumerate(modes, 1):
        amplitude = mode.amplitude_m
        if measured is None:
            view.only(of=ONE_AMPLITUDE)
        else:
            harmonics = np.array([point.harmonics for point in measured.points])
            across, amplitude = peak(measured.points[0].channels, harmonics, measured.frequency_hz, view)
        order = np.argsort(mode.amplitude_m)
        lines = tuple(
            Line(amplitude[order], scale * getattr(mode, name)[order], scale * mode.bound_95(name)[order])
            for name, scale in (("modal_frequency_hz", 1.0), ("damping_ratio", 100.0))
        )
        name = f"repeat {number}" if len(modes) > 1 else ""
        told = tuple(notes[n] for n in order) if len(notes) == order.size else ()
        traces.append(Trace(name, lines, "model" if measured is None else "measured", told))
    panels = (
        Panel(across, Quantity("modal frequency", "Hz", "frequency")),
        Panel(across, Quantity("modal damping ratio", "%")),
    )
    return Curves(panels, tuple(traces), modes[0][1].specimen, omitted)


def transfer_curves(
    levels: Mapping[str, FrequencyResponseMatrix], view: View, omitted: str = "", origin: Origin = "measured"
) -> Curves:
    """Return the frequency response from the force to the channel at each level: size and phase."""
    view.only("channel", of="a frequency response has no harmonics; they are in the scatter over realisations")
    panels: tuple[Panel, ...] = ()
    traces = []
    for name, matrix in levels.items():
        motions = [row for row, channel in enumerate(matrix.outputs) if channel.role in ("drive", "response")]
        outputs = tuple(matrix.outputs[row] for row in motions)
        channel = motions[channel_of(outputs, view)]
        value = matrix.value[:, channel, 0]
        unit = unit_text(f"{matrix.outputs[channel].unit}/{matrix.inputs[0].unit}")
        of = f"{matrix.outputs[channel].name} over {matrix.inputs[0].name}"
        panels = (
            Panel(FREQUENCY, Quantity(of, unit, "amplitude"), log=True),
            Panel(FREQUENCY, Quantity("phase", "deg")),
        )
        degrees = (np.degrees(np.angle(value)) + 90.0) % 360.0 - 90.0  # the curve has no jump at 0 or 180 deg
        lines = (Line(matrix.frequency_hz, np.abs(value)), Line(matrix.frequency_hz, degrees))
        traces.append(Trace(name, lines, origin))
    return Curves(panels, tuple(traces), next(iter(levels.values())).specimen, omitted)
