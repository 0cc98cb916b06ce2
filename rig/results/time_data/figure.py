"""Figure of time records: every channel over time, and its spectrum, one record of each level."""

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from identification import TimeRecord, TimeRecords
from rig.drawing.page import grid, legend_below
from rig.drawing.style import MAIN, TRACE_BINS, shade, title, unit_text
from vibrolock.arrays import Float

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_CHANNELS, _MOST_LEVELS = 6, 8
"""Largest numbers of channels and levels that are drawn; chosen for legibility."""
_SEGMENT = 4096
"""Samples of a segment of Welch's method; chosen."""
_THIN = 0.7
"""Width of lines, points; chosen."""


def draw_time_data(page: "Figure", data: TimeRecords) -> None:
    """Draw the first record of each level: extremes over time on the left, on the right amplitudes of the lines of a period.

    Of records that are not periodic the right shows the amplitude spectral density. The first six channels and at most eight
    levels are drawn; the title counts what is left out.
    """
    levels = data.levels()
    chosen = [list(levels.values())[i].records[0] for i in _spread(len(levels), _MOST_LEVELS)]
    channels = data.channels[:_MOST_CHANNELS]
    axes = grid(page, len(channels), 2)
    for row, channel in enumerate(channels):
        unit = unit_text(channel.unit)
        for index, record in list(enumerate(chosen))[::-1]:  # the smallest level in front
            colour = MAIN if len(chosen) == 1 else shade(index, len(chosen))
            label = f"{record.level:.4g} {data.level_unit}".strip() if len(levels) > 1 else None
            time_s, low, high = _extremes(record.samples[row], data.sample_rate_hz)
            axes[row, 0].fill_between(time_s, low, high, color=colour, lw=_THIN, label=label)
            axes[row, 1].semilogy(*_spectrum(record, row, data), color=colour, lw=_THIN)
        axes[row, 0].set(xlabel="time, s", ylabel=f"{channel.name}, {unit}")
        density = unit if data.period_samples else f"{unit}/√Hz"
        axes[row, 1].set(
            xlabel="frequency, Hz", ylabel=f"{channel.name}, {density}", xlim=(0.0, data.sample_rate_hz / 2)
        )
        if data.excited_hz is not None:
            axes[row, 1].axvspan(*data.excited_hz, color="0.94", zorder=0)
    if len(levels) > 1:
        legend_below(page, axes[0, 0])
    left = len(data.channels) - len(channels)
    more = f", {left} channels not drawn" if left else ""
    count = f"{len(data.records)} record{'' if len(data.records) == 1 else 's'}"
    of = f", {len(levels)} levels" if len(levels) > 1 else ""
    title(page, f"{data.specimen or 'specimen'}: time data, {count}{of}, {data.sample_rate_hz:g} Hz{more}")


def _spread(count: int, most: int) -> list[int]:
    """Return at most ``most`` numbers below ``count``, with the first and the last."""
    return sorted({round(at) for at in np.linspace(0, count - 1, min(count, most))})


def _extremes(values: Float, rate_hz: float) -> tuple[Float, Float, Float]:
    """Return instants, least and largest values of neighbouring samples, as many as a figure can show."""
    width = max(1, values.size // TRACE_BINS)
    bins = values[: values.size // width * width].reshape(-1, width)
    low, high = bins.min(axis=1), bins.max(axis=1)
    if width == 1:  # lines between neighbours
        low, high = np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])
    return np.arange(low.size) * width / rate_hz, low, high


def _spectrum(record: TimeRecord, row: int, data: TimeRecords) -> tuple[Float, Float]:
    """Return frequencies without 0 Hz, and peak amplitudes of the mean period or the amplitude spectral density."""
    values, rate, size = record.samples[row], data.sample_rate_hz, data.period_samples
    if size:
        lines = np.abs(np.fft.rfft(values.reshape(-1, size).mean(axis=0))) * (2.0 / size)
        frequency = np.arange(lines.size) * rate / size
    else:
        signal: Any = scipy.signal
        frequency, power = signal.welch(
            values, rate, nperseg=min(_SEGMENT, max(values.size // 8, min(values.size, 256)))
        )
        lines = np.sqrt(power)
    floor = 1e-9 * float(lines[1:].max(initial=0.0))
    return frequency[1:], np.where(lines[1:] > floor, lines[1:], np.nan)
