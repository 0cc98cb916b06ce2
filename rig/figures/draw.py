"""Figures of recordings, models and imported measurements. Every figure states specimen, units and what was left out."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification import IdentificationError, NonlinearMode, force_drop_out, nonlinear_mode
from rig.errors import RecordingError
from rig.figures.style import MAIN, REJECTED, SECOND, STYLE, TRACE_BINS
from rig.figures.transients import draw_multisine, draw_stepped_sine, draw_sweep
from rig.measurements import backbone, frequency_responses, point_rows, spectra, sweeps
from rig.models import FREQUENCY_RESPONSES, NONLINEAR_MODE, load_frequency_responses, load_model
from rig.recording.arrays import kind_of
from rig.recording.parts import Part
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot"]


def plot(source: Path, figure: Path) -> None:
    """Draw what is in ``source`` into ``figure`` (png, pdf or svg by its ending).

    Raises `RecordingError` where the file cannot be read or the figure not be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    if figure.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")
    kind = kind_of(source)
    with mpl.rc_context(STYLE):
        page = Figure(figsize=(9.0, 6.4), layout="constrained")
        if kind == NONLINEAR_MODE:
            page.set_size_inches(12.0, 6.4)
            _draw_mode(page, load_model(source))
        elif kind == FREQUENCY_RESPONSES:
            _draw_responses(page, source)
        else:
            with Recording(source) as recording:
                _DRAW[recording.kind](page, recording)
        try:
            page.savefig(figure)
        except OSError as error:
            raise RecordingError(f"{figure}: cannot be written: {error.strerror}") from None


def _engineering(amplitude_m: np.ndarray) -> tuple[np.ndarray, str]:
    """Amplitudes in millimetres or micrometres, whichever reads well."""
    if amplitude_m.size and np.nanmax(amplitude_m) < 5e-4:
        return amplitude_m * 1e6, "µm"
    return amplitude_m * 1e3, "mm"


def _properties(left: "Axes", right: "Axes", mode: NonlinearMode, colour: str = MAIN) -> None:
    """Modal frequency and damping over the amplitude."""
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = _engineering(mode.amplitude_m[order])
    error: dict[str, Any] = {"fmt": "o-", "ms": 4, "color": colour, "capsize": 2, "elinewidth": 0.8}
    left.errorbar(amplitude, mode.modal_frequency_hz[order], 1.96 * mode.modal_frequency_std_hz[order], **error)
    left.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
    if np.isfinite(mode.damping_ratio).any():
        right.errorbar(
            amplitude,
            100 * mode.damping_ratio[order],
            196 * mode.damping_ratio_std[order],
            label="one-mode fit" if mode.source == "stepped sine" else "active power of the fundamental",
            **error,
        )
        if np.isfinite(mode.damping_ratio_total_power).any():
            right.errorbar(
                amplitude,
                100 * mode.damping_ratio_total_power[order],
                196 * mode.damping_ratio_total_power_std[order],
                label="active power of all harmonics",
                **{**error, "fmt": "s--", "ms": 3.5, "color": SECOND},
            )
        right.legend(fontsize=8)
    else:
        _say(right, "damping needs the specimen's drive_mode_shape")
    right.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping ratio, %")
    _keep_small_changes_small(right)


def _say(axis: "Axes", text: str) -> None:
    """Why a panel is empty."""
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color=REJECTED)
    axis.set(xticks=[], yticks=[])


def _keep_small_changes_small(axis: "Axes") -> None:
    """Let the axis span a fifth of its middle at the least, so that scatter does not look like a trend."""
    low, high = axis.get_ylim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.1 * abs(low + high))
    axis.set_ylim(max(0.0, middle - half), middle + half)


def _title(page: "Figure", text: str) -> None:
    page.suptitle(text, fontsize=11, x=0.01, ha="left")


def _draw_mode(page: "Figure", mode: NonlinearMode) -> None:
    shapes, purities = np.isfinite(mode.mac).any(), np.isfinite(mode.force_purity).any()
    axes = page.subplots(2, 3 if shapes or purities else 2)
    _properties(axes[0, 0], axes[0, 1], mode)
    amplitude, unit = _engineering(mode.amplitude_m)
    order = np.argsort(mode.force_n)
    if shapes or purities:
        _draw_mac(axes[0, 2], mode)
        _draw_purity(axes[1, 2], mode)
    axes[1, 0].plot(mode.force_n[order], amplitude[order], "o-", ms=4, color=MAIN)
    axes[1, 0].set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement amplitude, {unit}")
    _harmonics(axes[1, 1], mode)
    _title(page, f"{mode.specimen or 'specimen'}: nonlinear mode from {mode.source}, {mode.force_n.size} points")


def _draw_mac(axis: "Axes", mode: NonlinearMode) -> None:
    """One minus the MAC on a logarithmic axis: what is close to one would be a line at the top."""
    if not np.isfinite(mode.mac).any():
        _say(axis, "MAC needs mode shapes")
        return
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = _engineering(mode.amplitude_m[order])
    low, high = np.maximum(1.0 - mode.interval("mac")[order, ::-1].T, 1e-12)
    axis.fill_between(amplitude, low, high, color=MAIN, alpha=0.2, lw=0)
    axis.semilogy(amplitude, np.maximum(1.0 - mode.mac[order], 1e-12), "o-", ms=4, color=MAIN)
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel="1 - MAC against the linear shape")


def _draw_purity(axis: "Axes", mode: NonlinearMode) -> None:
    """Share of the fundamental in force and motion, with its 95 % interval."""
    if not np.isfinite(mode.force_purity).any():
        _say(axis, "purity needs harmonics")
        return
    order = np.argsort(mode.force_n)
    for name, label, colour in (("force_purity", "force", MAIN), ("response_purity", "drive point", SECOND)):
        low, high = mode.interval(name)[order].T
        axis.fill_between(mode.force_n[order], low, high, color=colour, alpha=0.2, lw=0)
        axis.plot(mode.force_n[order], getattr(mode, name)[order], "o-", ms=4, color=colour, label=label)
    axis.set(xlabel="force amplitude (fundamental), N", ylabel="purity", ylim=(0.0, 1.05))
    axis.legend(fontsize=8)


def _harmonics(axis: "Axes", mode: NonlinearMode) -> None:
    order = np.argsort(mode.force_n)
    drawn = False
    for harmonic, marker in ((2, "^"), (3, "v")):
        if mode.force_harmonics.shape[1] > harmonic and np.isfinite(mode.force_harmonics).any():
            ratio = np.abs(mode.force_harmonics[:, harmonic]) / np.abs(mode.force_harmonics[:, 1])
            axis.plot(
                mode.force_n[order],
                ratio[order],
                marker + "-",
                ms=4,
                color=MAIN if harmonic == 2 else SECOND,
                label=f"|F{harmonic}|/|F1|",
            )
            drawn = True
    if drawn:
        axis.set(xlabel="force amplitude (fundamental), N", ylabel="harmonics of the force")
        axis.set_ylim(bottom=0.0)
        axis.legend(fontsize=8)
        return
    axis.plot(mode.modal_frequency_hz, _engineering(mode.amplitude_m)[0], "o-", ms=4, color=MAIN)
    axis.locator_params(axis="x", nbins=5)
    axis.set(xlabel="modal frequency, Hz", ylabel=f"displacement amplitude, {_engineering(mode.amplitude_m)[1]}")


def _draw_responses(page: "Figure", source: Path) -> None:
    from matplotlib import colormaps

    responses = load_frequency_responses(source)
    top, bottom = page.subplots(2, 1, sharex=True)
    everything = np.concatenate([response.amplitude_m for response in responses])
    unit = _engineering(everything)[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    for number, response in enumerate(responses):
        colour = colormaps["viridis"](number / max(1, len(responses) - 1) * 0.9)
        order = np.argsort(response.frequency_hz)
        label = response.label or f"{response.level:g}"
        line = ".--" if response.controlled == "force" else ".-"
        top.semilogy(response.frequency_hz[order], scale * response.amplitude_m[order], line, color=colour, label=label)
        bottom.plot(response.frequency_hz[order], response.phase_lag_deg[order], line, color=colour)
    top.set(ylabel=f"displacement amplitude, {unit}")
    bottom.set(xlabel="frequency, Hz", ylabel="phase lag of displacement, deg")
    bottom.axhline(90.0, color=REJECTED, lw=0.8)
    page.legend(fontsize=8, loc="outside right upper")
    _title(page, f"{responses[0].specimen or 'specimen'}: stepped-sine responses, {len(responses)} levels")


def _draw_backbone(page: "Figure", recording: Recording) -> None:
    axes = page.subplots(2, 2)
    try:
        mode: NonlinearMode | None = nonlinear_mode(backbone(recording))
    except IdentificationError:
        mode = None
    if mode is not None:
        _properties(axes[0, 0], axes[0, 1], mode)
    else:
        for axis in axes[0]:
            _say(axis, "no accepted point")
    _draw_history(axes[1, 0], axes[1, 1], recording)
    points = {point["number"]: point for point in recording.points}.values()
    left_out = sum(not point["accepted"] for point in points)
    text = f"{_specimen(recording)}: {recording.kind} test, {len(points)} point{'' if len(points) == 1 else 's'}"
    _title(page, text + (f", {left_out} not accepted" if left_out else ""))


def _specimen(recording: Recording) -> str:
    return str(recording.configuration["bench"]["specimen"]["name"])


def _draw_sweep(page: "Figure", recording: Recording) -> None:
    """The last sweep of a recording: its rows are read, and no others."""
    number, sweep = list(sweeps(recording).items())[-1]
    rows = point_rows(recording, number)
    point = next(point for point in reversed(recording.points) if point["number"] == number)
    draw_sweep(
        page,
        sweep,
        np.vstack([rows["inputs"].T, rows["output_v"]]),
        float(recording.configuration["bench"]["sample_rate_hz"]),
        drop_out=force_drop_out(sweep, off_resonance_hz=recording.configuration["plan"].get("off_resonance_hz")),
        title=f"{_specimen(recording)}: sweep at {point['level']:g} V, uncontrolled",
    )


def _draw_stepped_sine(page: "Figure", recording: Recording) -> None:
    responses = frequency_responses(recording)
    draw_stepped_sine(page, responses, title=f"{_specimen(recording)}: stepped sine, {len(responses)} levels")


def _draw_multisine(page: "Figure", recording: Recording) -> None:
    """The highest level of a recording."""
    level, at_level = max(spectra(recording).items())
    realisations = at_level.spectra.shape[0]
    title = f"{_specimen(recording)}: multisine, {level:g} V RMS, {realisations} realisations"
    draw_multisine(page, at_level, title=title)


_DRAW = {
    "backbone": _draw_backbone,
    "sweep": _draw_sweep,
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
    points = [point for point in part.points if "phase_error_deg" in point]
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
