"""Reads the curves of a file: one reader for each family of kinds that have the same axes."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from identification import (
    Backbone,
    ContinuousBackbone,
    FrequencyResponse,
    FrequencyResponseMatrix,
    IdentificationError,
    NonlinearMode,
    nonlinear_mode,
)
from rig.campaigns.evaluation.figure import refused
from rig.campaigns.evaluation.frequency_responses import passes_of
from rig.campaigns.evaluation.point import spectrum_of, vibration_of
from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.campaigns.evaluation.vibrations import channels_from
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.campaigns.multisine.points import recorded_response_matrices
from rig.campaigns.stepped_phase.figure import asked_lags, gaps
from rig.campaigns.stepped_sine.figure import jumps
from rig.campaigns.sweep.points import recorded_sweeps
from rig.check.recorded import is_check
from rig.drawing.folding import folds_back
from rig.drawing.style import unit_text
from rig.errors import RecordingError
from rig.figures.curves import Curves, Line, Panel, Quantity, Trace, View, channel_of, peak
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.kinds import KINDS

if TYPE_CHECKING:
    from rig.results.structured.kind import IdentifiedStructured

FREQUENCY = Quantity("frequency", "Hz", "frequency")
LAG = Quantity("phase lag of displacement", "deg")
FORCE = Quantity("fundamental force", "N", "amplitude")
DISPLACEMENT = Quantity("displacement amplitude", "m", "amplitude")
ONE_AMPLITUDE = "the file holds the fundamental of the drive point alone"


class _Family(NamedTuple):
    """Kinds whose files have the same axes."""

    name: str
    kinds: tuple[str, ...]
    read: Callable[[Any, View], Curves]
    """Reads a recording or a model."""


def curves_of(path: Path, view: View) -> Curves:
    """Return the curves of a file.

    Raises `RecordingError` if it cannot be read, has no curves or does not hold what the view asks for, and
    `IdentificationError` if no point was accepted; each names the file.
    """
    family = family_of(path)
    kind = kind_of(path)
    try:
        if kind in KINDS:
            return family.read(load(path), view)
        with Recording(path) as recording:
            return family.read(recording, view)
    except IdentificationError as error:
        raise IdentificationError(f"{path}: {error}") from None
    except RecordingError as error:
        text = str(error)
        raise error if text.startswith(str(path)) else RecordingError(f"{path}: {text}") from None


def family_of(path: Path) -> _Family:
    """Return the family of a file; raise `RecordingError` if it has no curves to lay over others."""
    kind = kind_of(path)
    if kind not in KINDS:
        with Recording(path) as recording:
            kind = "check" if is_check(recording) else kind
    for family in FAMILIES:
        if kind in family.kinds:
            return family
    known = ", ".join(name for family in FAMILIES for name in family.kinds)
    raise RecordingError(f"{path}: is of kind {kind}, which has no curves to lay over others; {known} have some")


def _backbones(source: "Recording | NonlinearMode | Backbone | IdentifiedStructured", view: View) -> Curves:
    """Modal frequency and damping over the amplitude, with 95 % intervals; a continuous backbone has one curve per repeat."""
    traces, across, modes = [], DISPLACEMENT, _modes(source)
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
        traces.append(Trace(f"repeat {number}" if len(modes) > 1 else "", lines))
    panels = (
        Panel(across, Quantity("modal frequency", "Hz", "frequency")),
        Panel(across, Quantity("modal damping ratio", "%")),
    )
    omitted = refused(points_of(source)) if isinstance(source, Recording) else ""
    return Curves(panels, tuple(traces), modes[0][1].specimen, omitted)


def _modes(
    source: "Recording | NonlinearMode | Backbone | IdentifiedStructured",
) -> list[tuple[Backbone | None, NonlinearMode]]:
    """Return the modes of a file, with the backbones that they were identified from where the file holds these."""
    if isinstance(source, NonlinearMode):
        return [(None, source)]
    if isinstance(source, Backbone):
        return [(source, nonlinear_mode(source))]
    if not isinstance(source, Recording):
        return [(None, _structured_mode(source))]
    measurements = CAMPAIGNS[source.kind].measurements
    if ContinuousBackbone in measurements:  # half of what lies between its ways is in the standard errors
        return [(ways.backbone, ways.nonlinear_mode()) for ways in measurements[ContinuousBackbone](source)]
    measured = measurements[Backbone](source)
    return [(measured, nonlinear_mode(measured))]


def _structured_mode(source: "IdentifiedStructured") -> NonlinearMode:
    """Return the nonlinear mode of a structured model; refuse code that the model names."""
    from identification import structured_mode  # a second, which other files need not wait for
    from rig.results.structured.kind import functions_of

    if functions := functions_of(source.model):
        raise RecordingError(f"names a function, {functions[0]}, which is not imported to draw; use structured_mode")
    return structured_mode(source.model if source.fit is None else source.fit)


def _responses(source: Recording | tuple[FrequencyResponse, ...], view: View) -> Curves:
    """Amplitude over frequency, and the phase lag of the fundamental; what folds back at constant force is told apart.

    Lines are interrupted where the amplitude jumps, or where a lag that was asked for is missing.
    """
    if not isinstance(source, Recording):
        return _stored_responses(source, view)
    channels, found = channels_from(source.channels), []
    panels: tuple[Panel, ...] = ()
    force, row = [channel.role for channel in channels].index("force"), channel_of(channels, view)
    points = points_of(source)
    for label, some in passes_of(points):
        frequency_hz = np.array([vibration_of(point).frequency_hz for point in some])
        harmonics = np.array([spectrum_of(point).harmonics for point in some])
        across, amplitude = peak(channels, harmonics, frequency_hz, view)
        if some[0].level_unit == "m":
            across, amplitude = _per_force(across, amplitude, np.abs(harmonics[:, force, 1]))
        drive = harmonics[:, [channel.role for channel in channels].index("drive"), 1]
        lag = np.degrees(np.angle(-harmonics[:, force, 1] / drive))
        held = some[0].level_unit in ("N", "N RMS") and source.kind == "stepped-phase"
        folded = _points_between(folds_back(frequency_hz, lag)) if held else None
        breaks = gaps(lag, asked_lags(points)) if source.kind == "stepped-phase" else np.array([], np.intp)
        breaks = jumps(amplitude) if source.kind == "stepped-sine" else breaks
        lines = [_broken(Line(frequency_hz, amplitude, None, folded), breaks)]
        panels = (Panel(FREQUENCY, across, log=some[0].level_unit == "m"),)
        if view.harmonic == 1 and channels[row].role in ("drive", "response"):
            turned = np.degrees(np.angle(-harmonics[:, force, 1] / harmonics[:, row, 1]))
            lines.append(_broken(Line(frequency_hz, turned, None, folded), breaks))
            panels = (*panels, Panel(FREQUENCY, LAG))
        found.append(Trace(label, tuple(lines)))
    return Curves(panels, tuple(found), specimen_of(source), refused(points))


def _stored_responses(responses: tuple[FrequencyResponse, ...], view: View) -> Curves:
    """Amplitude and phase lag of responses from a file, over frequency."""
    view.only(of=ONE_AMPLITUDE)
    traces = tuple(
        Trace(
            one.label or f"{one.level:g} {one.level_unit}",
            (Line(one.frequency_hz, one.amplitude_m), Line(one.frequency_hz, one.phase_lag_deg)),
        )
        for one in responses
    )
    return Curves((Panel(FREQUENCY, DISPLACEMENT), Panel(FREQUENCY, LAG)), traces, responses[0].specimen)


def _broken(line: Line, breaks: np.ndarray) -> Line:
    """Interrupt a line before some points."""
    folded = None if line.folded is None else np.insert(line.folded, breaks, False)
    return Line(np.insert(line.x, breaks, np.nan), np.insert(line.y, breaks, np.nan), None, folded)


def _per_force(across: Quantity, amplitude: np.ndarray, force_n: np.ndarray) -> tuple[Quantity, np.ndarray]:
    """Return an amplitude over the fundamental of the force: where the response is held, its amplitude tells nothing."""
    name = across.text.replace("displacement amplitude", "receptance").replace("amplitude", "response over force")
    return Quantity(name, f"{across.unit}/N", "amplitude"), amplitude / force_n


def _points_between(folded: np.ndarray) -> np.ndarray:
    """Return bool[n]: points with a folded piece on both sides, or at the end of one that ends the curve."""
    before, after = np.r_[folded[:1], folded], np.r_[folded, folded[-1:]]
    return np.asarray(before & after) if folded.size else np.zeros(1, bool)


def _transfer(source: Recording | FrequencyResponseMatrix, view: View) -> Curves:
    """Frequency response from the force to the channel: size and phase."""
    view.only("channel", of="a frequency response has no harmonics; they are in the scatter over realisations")
    if isinstance(source, Recording):
        levels = {f"{level:g} V RMS": one for level, one in recorded_response_matrices(source).items()}
        omitted = refused(points_of(source))
    else:
        levels, omitted = {"": source}, ""
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
        traces.append(Trace(name, (Line(matrix.frequency_hz, np.abs(value)), Line(matrix.frequency_hz, degrees))))
    return Curves(panels, tuple(traces), next(iter(levels.values())).specimen, omitted)


def _sweeps(source: Recording, view: View) -> Curves:
    """Fundamentals of the channel and of the force over the frequency of each sweep."""
    view.only("channel", of="sweeps are evaluated at their fundamental")
    points = {point.number: point for point in points_of(source)}
    panels: tuple[Panel, ...] = ()
    traces = []
    for number, sweep in recorded_sweeps(source).items():
        harmonics = np.stack([np.zeros_like(sweep.fundamentals.T), sweep.fundamentals.T], axis=-1)
        across, amplitude = peak(sweep.channels, harmonics, sweep.frequency_hz, view)
        panels = (Panel(FREQUENCY, across), Panel(FREQUENCY, FORCE))
        point = points[number]
        name = f"{point.level:g} {point.level_unit} {point.direction}" + (
            f" {point.repeat}" if point.repeat > 1 else ""
        )
        lines = (Line(sweep.frequency_hz, amplitude), Line(sweep.frequency_hz, np.abs(sweep.force)))
        traces.append(Trace(name, lines))
    return Curves(panels, tuple(traces), specimen_of(source), refused(list(points.values())))


FAMILIES = (
    _Family(
        "backbones",
        ("backbone", "continuous-backbone", "nonlinear-mode", "measured-backbone", "structured"),
        _backbones,
    ),
    _Family("frequency responses", ("stepped-sine", "stepped-phase", "frequency-responses"), _responses),
    _Family("response-controlled tests", ("response-controlled",), _responses),
    _Family("frequency response functions", ("multisine", "frequency-response-matrix"), _transfer),
    _Family("sweeps", ("sweep",), _sweeps),
)
"""Kinds that can be laid over one another, by what they have in common."""
