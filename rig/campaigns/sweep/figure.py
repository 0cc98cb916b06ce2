"""Figure of a sweep: voltage, force, response and instantaneous frequency over time."""

import numpy as np

from identification import ForceDropOut, Transient, force_drop_out, zero_crossings
from rig.campaigns.evaluation.figure import notes_of, refused
from rig.campaigns.evaluation.point import result_of
from rig.campaigns.evaluation.recorded import point_rows, points_of, specimen_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import VOLTAGE
from rig.campaigns.sweep.points import SweepResult, recorded_sweeps
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import columns_for, grid
from rig.drawing.style import MAIN, REJECTED, SECOND, TRACE_BINS, Axes, Figure, title as heading, unit_text
from rig.recording.reader import Recording
from vibrolock.arrays import Float

_TELLS = 0.98
"""Share of the zero crossings that must lie on the frequency axis for them to be drawn."""


def draw(page: Figure, recording: Recording) -> None:
    """Draw the last accepted sweep of a recording. A drop-out of the force is marked unless a loop held the force."""
    sweeps = recorded_sweeps(recording)
    number, sweep = list(sweeps.items())[-1]
    rows, point = point_rows(recording, number), point_from(recording.latest[number], SweepResult)
    held, left_out = result_of(point).held, refused(points_of(recording))
    text = f"sweep {point.direction} at {point.level:g} {point.level_unit}"
    text += f", the last of {len(sweeps)} accepted" if len(sweeps) > 1 else ""
    if held is not None:
        text += f", fundamental force {100.0 * held.held_least:.1f} to {100.0 * held.held_most:.1f} % of the level"
    off_resonance_hz = recording.configuration["plan"].get("off_resonance_hz")
    draw_sweep(
        page,
        sweep,
        np.vstack([rows["inputs"].T, rows["output_v"]]),
        float(recording.configuration["bench"]["sample_rate_hz"]),
        drop_out=None if held is not None else force_drop_out(sweep, off_resonance_hz=off_resonance_hz),
        note=notes_of([point])[0],
        title=f"{specimen_of(recording)}: {text}" + (f", {left_out}" if left_out else ""),
    )


def draw_sweep(
    page: Figure,
    sweep: Transient,
    samples: np.ndarray,
    sample_rate_hz: float,
    *,
    drop_out: ForceDropOut | None = None,
    note: str = "",
    title: str = "",
) -> None:
    """Draw voltage, force, response and instantaneous frequency over time.

    Parameters
    ----------
    page
        An empty figure, about 9 by 9 inches.
    sweep
        Fundamentals of the sweep; their envelopes are drawn over the signals.
    samples
        float[n_channels, n], the signals themselves, in the order of the channels of ``sweep``.
    sample_rate_hz
        Samples per second.
    drop_out
        Drop-out of the force, whose characteristic points are marked; None: no marks.
    note
        What is told of the fundamentals to who points at them, such as their quality.
    title
        Heading.
    """
    force = next(channel.name for channel in sweep.channels if channel.role == "force")
    axes = grid(page, 4, sharex=True, height_ratios=(1.0, 1.5, 1.5, 1.2))[:, 0]
    names = {VOLTAGE.name: "voltage", force: "force", "drive": "response (drive)"}
    longest = int(np.ceil(sample_rate_hz / sweep.frequency_hz.min()))
    for axis, (name, text) in zip(axes, names.items(), strict=False):
        row = sweep.index(name)
        _signal(axis, np.asarray(samples[row], dtype=np.float64), longest, sample_rate_hz)
        envelope = np.abs(sweep.fundamentals[row])
        for values, label in ((envelope, "fundamental"), (-envelope, None)):
            (drawn,) = axis.plot(sweep.time_s, values, color=SECOND, label=label)
            note_points(drawn, (), f"fundamental ({note})" if note else "")
        axis.set(ylabel=f"{text}, {unit_text(sweep.channels[row].unit)}")
    _momentary_frequency(axes[3], sweep, np.asarray(samples[sweep.index(force)]), sample_rate_hz)
    if drop_out is not None:
        _mark_drop_out(axes[1], axes[2], drop_out)
    above = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "borderaxespad": 0.0, "columnspacing": 1.0}
    for axis in axes[1:]:
        names = axis.get_legend_handles_labels()[1]
        axis.legend(ncols=columns_for(names, 0.85 * page.get_figwidth()), handlelength=1.4, **above)
    axes[3].set(xlabel="time, s", xlim=(0.0, samples.shape[1] / sample_rate_hz))
    heading(page, title)


def _signal(axis: Axes, values: Float, period: int, rate_hz: float) -> None:
    """Draw the range of a signal within one period around each instant; single oscillations would not be visible."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    at = np.arange(0, values.size, max(1, values.size // TRACE_BINS))
    lowest, highest = minimum_filter1d(values, period)[at], maximum_filter1d(values, period)[at]
    axis.fill_between(at / rate_hz, lowest, highest, color=MAIN, alpha=0.35, lw=0, label="signal")


def _momentary_frequency(axis: Axes, sweep: Transient, force: np.ndarray, rate_hz: float) -> None:
    """Draw the frequency of the voltage, of the force's fundamental, and from the zero crossings of the force.

    Zero crossings are left out where harmonics add some or shift them, so that they do not tell a frequency.
    """
    low, high = sweep.frequency_hz.min(), sweep.frequency_hz.max()
    margin = 0.25 * (high - low)
    halves = zero_crossings(force, sample_rate_hz=rate_hz)
    tells = np.mean((halves.frequency_hz > low - margin) & (halves.frequency_hz < high + margin)) > _TELLS
    if tells:
        label = "zero crossings of the force"
        axis.plot(halves.time_s, halves.frequency_hz, ".", ms=2.0, color=REJECTED, label=label)
    axis.plot(sweep.time_s, sweep.frequency_hz, color=MAIN, label="voltage")
    turning = np.unwrap(np.angle(sweep.force))
    own = sweep.frequency_hz + np.gradient(turning, sweep.time_s) / (2.0 * np.pi)
    axis.plot(sweep.time_s, own, color=SECOND, ls="--", label="fundamental of the force")
    if not tells:
        axis.plot([], [], " ", label="(zero crossings left out: harmonics shift them)")
    axis.set(ylabel="frequency, Hz", ylim=(low - margin, high + margin))


def _mark_drop_out(force: Axes, response: Axes, drop_out: ForceDropOut) -> None:
    """Mark the force off resonance, its minimum and overshoot, and the peak response, with their values."""
    force.axhline(drop_out.off_resonance_n, color=REJECTED, lw=0.8, ls="--")
    for name, marker in (("minimum", "v"), ("overshoot", "^")):
        values = (getattr(drop_out, f"{name}_{quantity}") for quantity in ("time_s", "n", "ratio", "frequency_hz"))
        seconds, newtons, ratio, frequency_hz = values
        label = f"{100 * ratio:.3g} % of {drop_out.off_resonance_n:.3g} N at {frequency_hz:.4g} Hz"
        force.plot(seconds, newtons, marker, color="black", label=label)
    label = f"largest displacement, {1e3 * drop_out.peak_m:.4g} mm at {drop_out.peak_frequency_hz:.4g} Hz"
    response.plot(drop_out.peak_time_s, drop_out.peak, "o", color="black", label=label)
