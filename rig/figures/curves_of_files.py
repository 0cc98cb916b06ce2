"""Reads the curves of a file: one reader for each family of kinds that have the same axes."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from identification import Backbone, ContinuousBackbone, IdentificationError, nonlinear_mode
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.figure import notes_of, refused
from rig.campaigns.evaluation.frequency_responses import passes_of
from rig.campaigns.evaluation.point import spectrum_of, vibration_of
from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.campaigns.evaluation.vibrations import channels_from
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.campaigns.multisine.points import recorded_response_matrices
from rig.campaigns.stepped_phase.figure import asked_lags, gaps
from rig.campaigns.stepped_sine.figure import jumps
from rig.campaigns.sweep.points import recorded_sweeps
from rig.check.findings import is_check
from rig.drawing.curves import (
    FORCE,
    FREQUENCY,
    LAG,
    Curves,
    Line,
    Panel,
    Quantity,
    Trace,
    View,
    backbone_curves,
    channel_of,
    peak,
    transfer_curves,
)
from rig.drawing.folding import folds_back
from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.kinds import KINDS


def curves_of(path: Path, family: str, view: View) -> Curves:
    """Return the curves of a file that are of a family which it has (`families_of`).

    Raises `RecordingError` if it cannot be read or does not hold what the view asks for, and
    `IdentificationError` if no point was accepted; each names the file.
    """
    kind = kind_of(path)
    try:
        if kind in KINDS:
            return KINDS[kind].curves_of(load(path), family, view)
        with Recording(path) as recording:
            return RECORDED[kind][1](recording, view)
    except IdentificationError as error:
        raise IdentificationError.of(error, where=path) from None
    except RecordingError as error:
        text = str(error)
        raise error if text.startswith(str(path)) else RecordingError(f"{path}: {text}") from None


def families_of(path: Path) -> tuple[str, ...]:
    """Return the families of the curves of a file; those of one family are laid over one another.

    Raises `RecordingError` if there are none.
    """
    kind = kind_of(path)
    if kind in KINDS:
        if families := KINDS[kind].families(partial(load, path)):
            return families
        predicts = KINDS[kind].prediction is not None
    else:
        predicts = False
        with Recording(path) as recording:
            kind = "check" if is_check(recording) else kind
        if kind in RECORDED:
            return (RECORDED[kind][0],)
    instead = "; plot it alone" + (", or what it predicts (rig predict)" if predicts else "")
    raise RecordingError(
        f"{path}: is of kind {kind}, which has no curves to lay over others or over axes of your own{instead}"
    )


def why_not_together(path: Path, other: Path) -> str:
    """Return that two files have no common axes and, of a model that predicts what the other holds, how to draw both."""
    names = [" and ".join(families_of(one)) for one in (path, other)]
    together = next(filter(None, (_as_prediction(path, other), _as_prediction(other, path))), "")
    return f"{path} and {other}: {names[0]} and {names[1]} have no common axes; draw them apart{together}"


def _as_prediction(model: Path, recording: Path) -> str:
    """Return how what a model predicts is drawn over a recording; empty if it is no model that predicts such."""
    kind, measured = kind_of(model), kind_of(recording)
    prediction = KINDS[kind].prediction if kind in KINDS else None
    if prediction is None or (measured in KINDS and measured != "frequency-responses"):
        return ""
    field, flag = _PREDICTED.get(families_of(recording)[0], ("", ""))
    if field not in prediction.options.model_fields:
        return ""
    return f", or predict first (rig predict {model} {flag} {recording}) and plot that"


_PREDICTED = {
    "frequency responses": ("references", "--reference"),
    "sweeps": ("sweeps", "--sweep"),
    "frequency response functions": ("multisines", "--multisine"),
}
"""By the family of a recording's curves: field and flag by which a model predicts the recording."""


def _backbones(source: Recording, view: View) -> Curves:
    """Modal frequency and damping over the amplitude; a continuous backbone has one curve per repeat."""
    measurements = CAMPAIGNS[source.kind].measurements
    omitted = refused(points_of(source))
    if ContinuousBackbone in measurements:  # half of what lies between its ways is in the standard errors
        found = measurements[ContinuousBackbone](source)
        return backbone_curves([(ways.backbone, ways.nonlinear_mode()) for ways in found], view, omitted)
    measured = measurements[Backbone](source)
    accepted = [point for point in without_repetition(points_of(source)) if point.accepted]
    return backbone_curves([(measured, nonlinear_mode(measured))], view, omitted, notes_of(accepted))


def _responses(source: Recording, view: View) -> Curves:
    """Amplitude over frequency, and the phase lag of the fundamental; what folds back at constant force is told apart.

    Lines are interrupted where the amplitude jumps, or where a lag that was asked for is missing.
    """
    channels, found = channels_from(source.channels), []
    panels: tuple[Panel, ...] = ()
    force, row = [channel.role for channel in channels].index("force"), channel_of(channels, view)
    points = points_of(source)
    for label, some in passes_of(points):
        frequency_hz = np.array([vibration_of(point).frequency_hz for point in some])
        harmonics = np.array([spectrum_of(point).harmonics for point in some])
        across, amplitude = peak(channels, harmonics, frequency_hz, view)
        if some[0].level_unit == "m":
            # where the response is held, its amplitude tells nothing: it is drawn over the force
            name = across.text.replace("displacement amplitude", "receptance")
            name = name.replace("amplitude", "response over force")
            across = Quantity(name, f"{across.unit}/N", "amplitude")
            amplitude = amplitude / np.abs(harmonics[:, force, 1])
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
        told = np.insert(np.array(notes_of(some), object), breaks, "")
        found.append(Trace(label, tuple(lines), notes=tuple(told)))
    return Curves(panels, tuple(found), specimen_of(source), refused(points))


def _broken(line: Line, breaks: np.ndarray) -> Line:
    folded = None if line.folded is None else np.insert(line.folded, breaks, False)
    return Line(np.insert(line.x, breaks, np.nan), np.insert(line.y, breaks, np.nan), None, folded)


def _points_between(folded: np.ndarray) -> np.ndarray:
    """Return bool[n]: points with a folded piece on both sides, or at the end of one that ends the curve."""
    before, after = np.r_[folded[:1], folded], np.r_[folded, folded[-1:]]
    return np.asarray(before & after) if folded.size else np.zeros(1, bool)


def _sweeps(source: Recording, view: View) -> Curves:
    view.only("channel", of="sweeps are evaluated at their fundamental")
    points = {point.number: point for point in points_of(source)}
    panels: tuple[Panel, ...] = ()
    traces = []
    for number, sweep in recorded_sweeps(source).items():
        harmonics = np.stack([np.zeros_like(sweep.fundamentals.T), sweep.fundamentals.T], axis=-1)
        across, amplitude = peak(sweep.channels, harmonics, sweep.frequency_hz, view)
        panels = (Panel(FREQUENCY, across), Panel(FREQUENCY, FORCE))
        point = points[number]
        repeat = f" {point.repeat}" if point.repeat > 1 else ""
        name = f"{point.level:g} {point.level_unit} {point.direction}{repeat}"
        lines = (Line(sweep.frequency_hz, amplitude), Line(sweep.frequency_hz, np.abs(sweep.force)))
        traces.append(Trace(name, lines))
    return Curves(panels, tuple(traces), specimen_of(source), refused(list(points.values())))


def _transfer(source: Recording, view: View) -> Curves:
    levels = {f"{level:g} V RMS": one for level, one in recorded_response_matrices(source).items()}
    return transfer_curves(levels, view, refused(points_of(source)))


RECORDED: Mapping[str, tuple[str, Callable[[Recording, View], Curves]]] = {
    "backbone": ("backbones", _backbones),
    "continuous-backbone": ("backbones", _backbones),
    "stepped-sine": ("frequency responses", _responses),
    "stepped-phase": ("frequency responses", _responses),
    "response-controlled": ("response-controlled tests", _responses),
    "multisine": ("frequency response functions", _transfer),
    "sweep": ("sweeps", _sweeps),
}
"""By the kind of a recording: the family of its curves, which can be laid over one another, and what reads them."""
