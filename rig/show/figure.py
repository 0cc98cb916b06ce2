"""Figures of recordings, models and imported measurements. Every figure states specimen, units and omitted data."""

from pathlib import Path
from pkgutil import resolve_name

from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.check.recorded import is_check
from rig.errors import RecordingError
from rig.figures.page import page_for
from rig.models.files.files import KINDS, load, understood
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.show.lateness_figure import draw_lateness

__all__ = ["plot"]

CHECK = "rig.check.figure:draw_recorded_check"


def plot(source: Path, figure: Path, *, lateness: bool = False) -> None:
    """Draw the contents of ``source`` into ``figure`` (png, pdf or svg, by its suffix).

    With ``lateness``, draw the timing of the recording's control loop instead. Raises `RecordingError` if the file cannot be
    read or the figure cannot be written.
    """
    if figure.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")
    if figure.is_dir():
        raise RecordingError(f"{figure}: is a folder, the name of a file is wanted")
    if figure.exists() and source.exists() and figure.samefile(source):
        raise RecordingError(f"{figure}: is the file that is read; choose another name")
    kind = kind_of(source)
    size_in = KINDS[kind].figure_in if kind in KINDS and not lateness else (9.0, 6.4)
    with page_for(figure, size_in) as page:
        if lateness:
            with Recording(source) as recording:
                draw_lateness(page, recording)
        elif kind in KINDS:
            found = load(source)
            with understood(source, kind):
                resolve_name(KINDS[kind].draw)(page, found)
        else:
            with Recording(source) as recording:
                draw = CHECK if is_check(recording) else CAMPAIGNS[recording.kind].draw
                resolve_name(draw)(page, recording)
