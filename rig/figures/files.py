"""Figures of recordings, models and imported measurements. Every figure states specimen, units and omitted data."""

from collections.abc import Callable, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TypedDict

from identification import IdentificationError
from rig.campaigns.evaluation.figure import draw_failure
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.check.findings import is_check
from rig.drawing.curves import View
from rig.drawing.page import check_ending, check_replaceable, page_for
from rig.drawing.style import Figure
from rig.errors import RecordingError
from rig.figures.lateness import draw_lateness
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load, understood
from rig.results.kinds import KINDS

CHECK = "rig.check.figure:draw_recorded_check"


def plot(
    source: Path | Sequence[Path],
    figure: Path,
    *,
    lateness: bool = False,
    labels: Sequence[str] = (),
    view: View | None = None,
    panels: Sequence[str] = (),
    overwrite: bool = False,
) -> None:
    """Draw the contents of ``source`` into ``figure`` (png, pdf, svg, or html to zoom in a browser, by its suffix).

    With ``lateness``, draw the timing of the recording's control loop instead. Of several files, or with ``labels`` or a
    ``view``, draw the curves alone, over one another (`rig.figures.overlay.overlay`). ``panels``: the parts of a recording's
    figure that are drawn, by name. Without ``overwrite``, only figures of
    this program are replaced. Raises `RecordingError` if a file cannot be read or the figure cannot be written.
    """
    sources = [source] if isinstance(source, Path) else list(source)
    check_ending(figure)
    if figure.is_dir():
        raise RecordingError(f"{figure}: is a folder, the name of a file is expected")
    if figure.exists() and any(one.exists() and figure.samefile(one) for one in sources):
        raise RecordingError(f"{figure}: is the file that is read; choose another name")
    if not overwrite:
        check_replaceable(figure)
    size_in, draw = drawing_of(sources, lateness=lateness, labels=labels, view=view, panels=panels)
    with page_for(figure, size_in) as page:
        draw(page)


class FileOptions(TypedDict, total=False):
    """How files are drawn."""

    lateness: bool
    labels: Sequence[str]
    view: View | None
    panels: Sequence[str]


def drawing_of(
    sources: Sequence[Path],
    *,
    lateness: bool = False,
    labels: Sequence[str] = (),
    view: View | None = None,
    panels: Sequence[str] = (),
) -> tuple[tuple[float, float], Callable[[Figure], None]]:
    """Return the size (inches) of the page for one or several files, and the function that draws them on an empty page.

    The arguments are those of `plot`.
    """
    curves = len(sources) > 1 or bool(labels) or view is not None
    if lateness and curves:
        raise RecordingError("`lateness`: is drawn of one recording, without labels and axes of one's own")
    if panels and (curves or lateness):
        raise RecordingError(
            "`panels`: are those of one recording's figure, without labels, axes of one's own and lateness"
        )
    if not curves:
        return drawing(sources[0], lateness=lateness, panels=panels)
    from rig.figures.overlay import overlay  # which knows the curves of every kind of file

    return overlay(sources, labels, view)


def drawing(
    source: Path, *, lateness: bool = False, panels: Sequence[str] = ()
) -> tuple[tuple[float, float], Callable[[Figure], None]]:
    """Return the size (inches) of the page for a file, and the function that draws the file's contents on an empty page.

    The arguments are those of `plot`. Raises `RecordingError` if the file is not one of ours; the function raises it, too.
    """
    kind = kind_of(source)
    _check_panels(kind, source, panels)
    if kind in KINDS and not lateness:
        return KINDS[kind].figure_in, lambda page: _draw_model(page, source, kind)
    size_in = CAMPAIGNS[kind].figure_in if kind in CAMPAIGNS and not lateness else (9.0, 6.4)
    return size_in, lambda page: _draw_recording(page, source, panels, lateness=lateness)


def _check_panels(kind: str, source: Path, panels: Sequence[str]) -> None:
    """Raise `RecordingError` for a panel that the figure of a file does not have."""
    there = CAMPAIGNS[kind].panels if kind in CAMPAIGNS else ()
    for name in panels:
        if name not in there:
            allowed = ", ".join(there) or "none, for the figure of this kind is drawn as a whole"
            raise RecordingError(f"`panels` {name}: {source} is of kind {kind}; allowed: {allowed}")


def _draw_model(page: Figure, source: Path, kind: str) -> None:
    found = load(source)
    with understood(source, kind):
        KINDS[kind].draw_on(page, found)


def _draw_recording(page: Figure, source: Path, panels: Sequence[str], *, lateness: bool) -> None:
    with Recording(source) as recording:
        if lateness:
            draw_lateness(page, recording)
            return
        try:
            draw = resolve_name(CHECK if is_check(recording) else CAMPAIGNS[recording.kind].draw)
            draw(page, recording, **({"panels": panels} if panels else {}))
        except IdentificationError:
            if any(point.accepted for point in points_of(recording)):
                raise
            page.clear()
            draw_failure(page, recording)
