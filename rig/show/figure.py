"""Figures of recordings, models and imported measurements. Every figure states specimen, units and what was left out."""

from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import numpy as np

from identification import ForceSurface, IdentificationError, NonlinearMode, force_drop_out, nonlinear_mode
from rig.campaigns.continuous_backbone.figure import draw_differences, draw_ways
from rig.campaigns.stepped_phase.figure import draw_stepped_phase
from rig.check.assessment import assess, is_check
from rig.check.figure import draw_check
from rig.errors import RecordingError
from rig.figures.force_surface import draw_force_surface
from rig.figures.nonlinear_mode import draw_properties
from rig.figures.style import MAIN, SECOND, STYLE, TRACE_BINS, say_why_empty, title
from rig.figures.transients import draw_multisine, draw_stepped_sine, draw_sweep
from rig.measurements import backbone, force_surface, frequency_responses, point_rows, spectra, sweeps
from rig.models.files.files import KINDS, load, understood
from rig.recording.arrays import kind_of
from rig.recording.parts import Part
from rig.recording.reader import Recording
from rig.show.lateness_figure import draw_lateness

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot"]


def plot(source: Path, figure: Path, *, lateness: bool = False) -> None:
    """Draw what is in ``source`` into ``figure`` (png, pdf or svg by its ending).

    With ``lateness`` it is how punctual the loop of a recording was.

    Raises `RecordingError` where the file cannot be read or the figure not be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    if figure.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")
    if figure.is_dir():
        raise RecordingError(f"{figure}: is a folder, the name of a file is wanted")
    if figure.exists() and source.exists() and figure.samefile(source):
        raise RecordingError(f"{figure}: is the file that is read; choose another name")
    kind = kind_of(source)
    with mpl.rc_context(STYLE):
        page = Figure(figsize=(9.0, 6.4), layout="constrained")
        if lateness:
            with Recording(source) as recording:
                draw_lateness(page, recording)
        elif kind in KINDS:
            page.set_size_inches(*KINDS[kind].figure_in)
            found = load(source)
            with understood(source, kind):
                resolve_name(KINDS[kind].draw)(page, found)
        else:
            with Recording(source) as recording:
                draw = _draw_check if is_check(recording) else _DRAW[recording.kind]
                draw(page, recording)
        try:
            page.savefig(figure)
        except OSError as error:
            raise RecordingError(f"{figure}: cannot be written: {error.strerror}") from None


def _draw_check(page: "Figure", recording: Recording) -> None:
    draw_check(page, assess(recording))


def _draw_backbone(page: "Figure", recording: Recording) -> None:
    axes = page.subplots(2, 2)
    try:
        mode: NonlinearMode | None = nonlinear_mode(backbone(recording))
    except IdentificationError:
        mode = None
    if mode is not None:
        draw_properties(axes[0, 0], axes[0, 1], mode)
    else:
        for axis in axes[0]:
            say_why_empty(axis, "no accepted point")
    _draw_history(axes[1, 0], axes[1, 1], recording)
    _say_what_it_is(page, recording)


def _draw_continuous_backbone(page: "Figure", recording: Recording) -> None:
    page.set_size_inches(9.0, 9.6)
    axes = page.subplots(3, 2)
    points = list(recording.latest.values())
    draw_ways(axes[0], points)
    draw_differences(axes[1], points)
    _draw_history(axes[2, 0], axes[2, 1], recording)
    _say_what_it_is(page, recording)


def _say_what_it_is(page: "Figure", recording: Recording) -> None:
    points = recording.latest.values()
    left_out = sum(not point["accepted"] for point in points)
    text = f"{_specimen(recording)}: {recording.kind} test, {len(points)} point{'' if len(points) == 1 else 's'}"
    title(page, text + (f", {left_out} not accepted" if left_out else ""))


def _specimen(recording: Recording) -> str:
    return str(recording.configuration["bench"]["specimen"]["name"])


def _draw_sweep(page: "Figure", recording: Recording) -> None:
    """The last sweep of a recording: its rows are read, and no others."""
    number, sweep = list(sweeps(recording).items())[-1]
    rows = point_rows(recording, number)
    point = recording.latest[number]
    draw_sweep(
        page,
        sweep,
        np.vstack([rows["inputs"].T, rows["output_v"]]),
        float(recording.configuration["bench"]["sample_rate_hz"]),
        drop_out=force_drop_out(sweep, off_resonance_hz=recording.configuration["plan"].get("off_resonance_hz")),
        title=f"{_specimen(recording)}: sweep at {point['level']:g} {point['level_unit']}, {_held(point)}",
    )


def _held(point: dict[str, Any]) -> str:
    """What was controlled in a sweep, and how well."""
    if "held_least" not in point:
        return "uncontrolled"
    return f"held within {100.0 * point['held_least']:.1f} to {100.0 * point['held_most']:.1f} %"


def _draw_stepped_sine(page: "Figure", recording: Recording) -> None:
    responses = frequency_responses(recording)
    draw_stepped_sine(page, responses, title=f"{_specimen(recording)}: stepped sine, {len(responses)} levels")


def _draw_stepped_phase(page: "Figure", recording: Recording) -> None:
    points = recording.latest.values()
    left_out = sum(not point["accepted"] for point in points)
    text = f"{_specimen(recording)}: stepped phase, {len(points)} points"
    plan = recording.configuration["plan"]
    draw_stepped_phase(
        page,
        frequency_responses(recording),
        held="RMS of the force" if plan.get("levels_rms_n") else "",
        title=text + (f", {left_out} not accepted" if left_out else ""),
        lags_deg=sorted({point["asked_phase_lag_deg"] + 180.0 for point in points}),
    )


def _draw_response_controlled(page: "Figure", recording: Recording) -> None:
    """Every level, and the surface through them where there are enough."""
    page.set_size_inches(11.0, 7.0)
    responses = frequency_responses(recording)
    try:
        surface: ForceSurface | None = force_surface(recording)
    except IdentificationError:
        surface = None
    points = recording.latest.values()
    left_out = sum(not point["accepted"] for point in points)
    text = f"{_specimen(recording)}: response-controlled test, {len(points)} points"
    draw_force_surface(page, responses, surface, text=text + (f", {left_out} not accepted" if left_out else ""))


def _draw_multisine(page: "Figure", recording: Recording) -> None:
    """The highest level of a recording."""
    level, at_level = max(spectra(recording).items())
    realisations = at_level.spectra.shape[0]
    title = f"{_specimen(recording)}: multisine, {level:g} V RMS, {realisations} realisations"
    draw_multisine(page, at_level, title=title)


_DRAW = {
    "backbone": _draw_backbone,
    "continuous-backbone": _draw_continuous_backbone,
    "sweep": _draw_sweep,
    "stepped-phase": _draw_stepped_phase,
    "response-controlled": _draw_response_controlled,
    "stepped-sine": _draw_stepped_sine,
    "multisine": _draw_multisine,
}


def _draw_history(frequency: "Axes", error: "Axes", recording: Recording) -> None:
    """The loop over time: oscillator frequency with the output amplitude, and the phase error; mean and range of each bin."""
    rate = float(recording.configuration["bench"]["sample_rate_hz"])
    level = frequency.twinx()
    width = max(1, recording.n_rows // TRACE_BINS)
    start, largest = 0, 1.0
    for part in recording.parts:
        if part.n_rows < width:
            continue
        bins = part.n_rows // width
        seconds = (start + width * (np.arange(bins) + 0.5)) / rate
        _band(frequency, seconds, part.rows("frequency_hz"), width)
        level.plot(seconds, _binned(np.abs(part.rows("command_v")), width).mean(axis=1), color=SECOND, lw=0.9)
        degrees = np.degrees(part.rows("phase_error_rad"))
        _band(error, seconds, degrees, width, label="detector" if start == 0 else None)
        running = degrees[(part.rows("segment") >= 0) & np.isfinite(degrees)]
        largest = max(largest, float(np.quantile(np.abs(running), 0.995)) if running.size else 0.0)
        largest = max(largest, _mark_points(error, part, start, rate))
        start += part.n_rows
    frequency.set(xlabel="time, s", ylabel="oscillator frequency, Hz")
    frequency.yaxis.label.set_color(MAIN)
    level.set_ylabel("output amplitude, V", color=SECOND)
    level.grid(False)
    level.spines["right"].set_visible(True)
    error.set(xlabel="time, s", ylabel="phase error, deg", ylim=(-1.3 * largest, 1.3 * largest))
    if error.get_legend_handles_labels()[0]:
        error.legend(fontsize=8, loc="upper right")


def _mark_points(axis: "Axes", part: Part, start: int, rate: float) -> float:
    """Mark the phase error of every recorded fundamental of a part; returns the largest, deg."""
    points = [point for point in part.points if "phase_error_deg" in point and point["settled"] is not None]
    if not points:
        return 0.0
    seconds = [(start + 0.5 * (point["first_sample"] + point["end_sample"])) / rate for point in points]
    degrees = [point["phase_error_deg"] for point in points]
    axis.plot(seconds, degrees, "D", ms=4, color=SECOND, label="recorded fundamental" if start == 0 else None)
    return float(np.max(np.abs(degrees)))


def _binned(values: np.ndarray, width: int) -> np.ndarray:
    """``values`` in rows of ``width``; an incomplete row at the end is left out."""
    return np.asarray(values[: values.size // width * width].reshape(-1, width))


def _band(axis: "Axes", seconds: np.ndarray, values: np.ndarray, width: int, label: str | None = None) -> None:
    """Mean of each bin as a line, its range as a band: plain decimation would alias the ripple of the detector."""
    rows = _binned(values.astype(float), width)
    rows = np.where(np.isfinite(rows).all(axis=1, keepdims=True), rows, np.nan)  # gaps stay gaps
    axis.fill_between(seconds, rows.min(axis=1), rows.max(axis=1), color=MAIN, alpha=0.25, lw=0)
    axis.plot(seconds, rows.mean(axis=1), color=MAIN, lw=0.8, label=label)
