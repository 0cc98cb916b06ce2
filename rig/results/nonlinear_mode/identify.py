"""Identify nonlinear modes from backbones, decays or stepped sines."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from identification import (
    Backbone,
    ContinuousBackbone,
    DecayBackbone,
    IdentificationError,
    LinearModes,
    NonlinearMode,
    combined,
    nonlinear_mode,
    stepped_sine_mode,
)
from rig.campaigns.kinds import kinds_that_yield
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import STEPPED, backbone, continuous_backbones
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load, load_as
from rig.results.kind import Progress
from rig.results.kinds import KINDS
from rig.results.measured import modes_in, stepped_sines
from rig.results.nonlinear_mode.options import NonlinearModeOptions


def identify(paths: Sequence[Path], options: NonlinearModeOptions, progress: Progress | None = None) -> NonlinearMode:
    """Identify a nonlinear mode from one or several backbones, or from stepped sines (imported or response-controlled)."""
    kinds = {kind_of(path): path for path in paths}
    modes = None if options.modes is None else modes_in(options.modes)
    if set(kinds) == {"decay-backbone"}:
        return _mode_of_decay(paths, options)
    if options.near:
        raise ConfigurationError("`near`: names a mode of a decay, and the files are none; leave it out")
    if set(kinds) <= {"frequency-responses", *STEPPED} and not _have_resonances(paths, modes):
        if modes is not None:
            raise ConfigurationError("`modes`: stepped sines of one sensor have no use for mode shapes; leave it out")
        return _stepped_mode(paths)
    identified = []
    for path in paths:
        runs, notes = _backbones(path)
        for run in runs:
            found = (
                run.nonlinear_mode(modes=modes)
                if isinstance(run, ContinuousBackbone)
                else nonlinear_mode(run, modes=modes)
            )
            identified.append(replace(found, notes=(*notes, *found.notes)))
    return identified[0] if len(identified) == 1 else combined(identified)


def _have_resonances(paths: Sequence[Path], modes: LinearModes | None) -> bool:
    """Whether all files are recordings with points at phase resonance and a mass-normalised mode shape to evaluate them."""
    for path in paths:
        if kind_of(path) not in kinds_that_yield(Backbone):
            return False
        with Recording(path) as recording:
            try:
                found = backbone(recording)
            except IdentificationError:
                return False
        if found.drive_mode_shape is None and modes is None:
            return False
    return True


def _mode_of_decay(paths: Sequence[Path], options: NonlinearModeOptions) -> NonlinearMode:
    if len(options.near) > 1:
        raise ConfigurationError(f"`near`: {len(options.near)} given, a nonlinear mode is one")
    near = next(iter(options.near), None)
    found = [load_as(DecayBackbone, path).nonlinear_mode(near) for path in paths]
    return found[0] if len(found) == 1 else combined(found)


def _stepped_mode(paths: Sequence[Path]) -> NonlinearMode:
    """Identify a nonlinear mode from levels of a held response; refuse stepped sines at force or voltage levels.

    At such levels the amplitude of the mode varies along each response.
    """
    stepped, missing = stepped_sines(paths)
    if all(item.controlled != "response" for item in stepped):
        raise ConfigurationError(
            f"{', '.join(map(str, paths))}: frequency responses at levels of force or voltage, not a mode (`rig plot` shows "
            "them); a nonlinear mode comes from backbones, or from levels of a held response"
        )
    try:
        found = stepped_sine_mode(stepped)
    except IdentificationError as error:
        raise IdentificationError(
            f"{error}; `kind` force-surface takes levels of held displacement as they are"
        ) from None
    return replace(found, notes=(*missing, *found.notes))


def _backbones(path: Path) -> tuple[Sequence[Backbone | ContinuousBackbone], tuple[str, ...]]:
    """Backbones in a recording, one for each repeat of a continuous backbone, and a note on planned points that are missing."""
    kind = kind_of(path)
    if kind in KINDS and isinstance(measured := load(path), Backbone):
        return (measured,), ()
    if kind not in kinds_that_yield(Backbone):
        raise RecordingError(
            f"{path}: holds a {kind}; a nonlinear mode comes from backbones, or from stepped sines alone"
        )
    with Recording(path) as recording:
        notes = points_left_out(recording)
        continuous = kind in kinds_that_yield(ContinuousBackbone)
        return (continuous_backbones(recording) if continuous else (backbone(recording),)), notes
