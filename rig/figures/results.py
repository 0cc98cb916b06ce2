"""Figures of results in memory, for notebooks and scripts. What is drawn how is one table here."""

from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple

from identification import FrequencyResponse
from rig.drawing.style import STYLE, page_in
from rig.figures.files import drawing_of
from rig.recording.reader import Recording
from rig.results.kinds import as_kept, kind_of_file_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class ResultFigure(NamedTuple):
    """How one type of result is drawn."""

    draw: str
    """``module:function`` that draws the result on an empty page, ``(page, result)``."""
    figure_in: tuple[float, float] = (9.0, 4.0)
    """Width and height of the page, inches."""


RESULTS = {
    "FrequencyResponse": ResultFigure("rig.figures.responses:draw_response", (9.0, 6.4)),
    "ForceSurface": ResultFigure("rig.figures.responses:draw_surface", (11.0, 4.5)),
    "ConstantForceCurve": ResultFigure("rig.figures.responses:draw_constant_force"),
    "Comparison": ResultFigure("rig.figures.responses:draw_comparison"),
    "SteadyPrediction": ResultFigure("rig.figures.responses:draw_prediction", (9.0, 6.0)),
    "ResponseBand": ResultFigure("rig.figures.responses:draw_band"),
    "SweepPrediction": ResultFigure("rig.figures.responses:draw_prediction", (9.0, 5.0)),
    "ContinuousBackbone": ResultFigure("rig.figures.backbones:draw_continuous"),
    "PeriodicResponses": ResultFigure("rig.figures.backbones:draw_periodic"),
    "DistortionLevels": ResultFigure("rig.figures.spectra:draw_distortion", (9.0, 6.4)),
    "PeriodicSpectra": ResultFigure("rig.campaigns.multisine.figure:draw_multisine", (9.0, 6.4)),
    "StabilisationDiagram": ResultFigure("rig.figures.spectra:draw_stabilisation"),
    "Transient": ResultFigure("rig.figures.spectra:draw_transient", (9.0, 8.0)),
    "Tuning": ResultFigure("rig.tuning.figure:draw_on", (11.0, 6.8)),
    "Assessment": ResultFigure("rig.check.figure:draw_check", (9.0, 6.4)),
}
"""By the name of the type: results that no file of ours holds. For others see `rig.results.kinds`."""


def plot(thing: Any, *others: Any, page: "Figure | None" = None, **options: Any) -> "tuple[Axes, ...]":
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

            page = pyplot.figure(figsize=page_in(size_in), layout="constrained")
        draw(page)
    return tuple(page.axes)


def _drawing_of(things: tuple[Any, ...], options: dict[str, Any]) -> tuple[tuple[float, float], Callable[[Any], None]]:
    """Return the size of the page, inches, and what draws on it."""
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
    found = next((RESULTS[one.__name__] for one in type(thing).__mro__ if one.__name__ in RESULTS), None)
    if found is not None:
        return found.figure_in, lambda page: resolve_name(found.draw)(page, thing)
    kind = kind_of_file_for(thing)
    if kind is None or (isinstance(thing, tuple) and not all(isinstance(one, FrequencyResponse) for one in thing)):
        raise TypeError(f"plot: no figure for {type(thing).__name__}; allowed are files, runs, recordings and results")
    return kind.figure_in, lambda page: resolve_name(kind.draw)(page, as_kept(kind, thing))


def _file_of(thing: Any) -> Path | None:
    """Return the file of a path, a run or a recording; None for anything else."""
    if isinstance(thing, str | Path):
        return Path(thing)
    recording = getattr(thing, "recording", thing)  # of a run
    return recording.path if isinstance(recording, Recording) else None
