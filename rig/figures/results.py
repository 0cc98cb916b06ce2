"""Figures of results in memory, for notebooks and scripts."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Unpack

from identification import FrequencyResponse
from rig.drawing.layout import page_layout
from rig.drawing.style import STYLE, Axes, Figure, page_in
from rig.figures.files import FileOptions, drawing_of
from rig.recording.reader import Recording
from rig.results.kinds import kind_of_result


def plot(thing: Any, *others: Any, page: Figure | None = None, **options: Unpack[FileOptions]) -> tuple[Axes, ...]:
    """Draw a result, a file or a run; return the axes of the figure, from the top left to the bottom right.

    Parameters
    ----------
    thing
        Path of a file that ``rig plot`` draws; a `rig.Run` or `rig.Recording`; a result of identification, of an analysis of a
        virtual rig, of tuning, rehearsal or check; or several `identification.FrequencyResponse` in one tuple.
    others
        Further files, runs or recordings, whose curves are laid over those of the first.
    page
        Empty figure to draw on. Default: a new figure of pyplot, in the size of ``rig plot``.
    options
        Of files, runs and recordings: ``labels``, names in the legend; ``view``, a `rig.figures.View` with the axes, the
        channel and the harmonic; ``lateness=True`` for the timing of the control loop.

    Raises
    ------
    TypeError
        If there is no figure for this type.
    rig.errors.RecordingError
        If a file cannot be read.
    """
    import matplotlib as mpl

    size_in, draw = _drawing_of((thing, *others), options)
    style = {key: value for key, value in STYLE.items() if key != "figure.dpi"}  # that of the screen
    with mpl.rc_context(style):
        if page is None:
            from matplotlib import pyplot

            page = pyplot.figure(figsize=page_in(size_in), layout=page_layout())
        draw(page)
    return tuple(page.axes)


def _drawing_of(things: tuple[Any, ...], options: FileOptions) -> tuple[tuple[float, float], Callable[[Any], None]]:
    files = [found for found in map(_file_of, things) if found is not None]
    if len(files) == len(things):
        return drawing_of(files, **options)
    if options or len(things) > 1:
        given = ", ".join(options) or f"{len(things)} things"
        raise TypeError(f"plot: {given}: allowed for files, runs and recordings alone")
    (thing,) = things
    draw_on = getattr(thing, "draw_on", None)  # of an analysis
    if draw_on is not None:
        return thing.figure_in, draw_on
    kind = kind_of_result(thing)
    if kind is None or (isinstance(thing, tuple) and not all(isinstance(one, FrequencyResponse) for one in thing)):
        raise TypeError(f"plot: no figure for {type(thing).__name__}; allowed are files, runs, recordings and results")
    return kind.figure_in, lambda page: kind.draw_on(page, thing)


def _file_of(thing: Any) -> Path | None:
    if isinstance(thing, str | Path):
        return Path(thing)
    recording = getattr(thing, "recording", thing)  # of a run
    return recording.path if isinstance(recording, Recording) else None
