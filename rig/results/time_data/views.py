"""Table and figure of time records that were measured with other systems."""

from typing import Any

import numpy as np
import scipy

from identification import TimeRecord, TimeRecords
from identification.experiments import period_remark
from rig.drawing.page import grid, legend_below
from rig.drawing.style import MAIN, TRACE_BINS, Figure, shade, title, unit_text
from rig.results.kind import Table
from rig.text.column import Column
from rig.text.console import print_rows
from vibrolock.arrays import Float


def _summarise(data: TimeRecords) -> dict[str, Any]:
    rate, size = data.sample_rate_hz, data.period_samples
    return {
        "specimen": data.specimen,
        "source": data.source,
        "sample_rate_hz": rate,
        "period_samples": size,
        "resolution_hz": rate / size if size else None,
        "ahead_periods": data.ahead_periods if size else None,
        "excited_hz": None if data.excited_hz is None else list(data.excited_hz),
        "at_rest": data.at_rest,
        "instrument": data.instrument,
        "channels": [
            {
                **vars(channel),
                "rms": float(np.sqrt(np.mean([np.mean(one.samples[row] ** 2) for one in data.records]))),
                "largest": max(float(np.abs(one.samples[row]).max()) for one in data.records),
                "mean": float(np.mean([one.samples[row].mean() for one in data.records])),
            }
            for row, channel in enumerate(data.channels)
        ],
        "level_unit": data.level_unit,
        "records": [
            {
                "name": one.name,
                "level": None if np.isnan(one.level) else one.level,
                "samples": one.samples.shape[1],
                "periods": one.samples.shape[1] // size if size else None,
                "duration_s": one.samples.shape[1] / rate,
            }
            for one in data.records
        ],
        "notes": list(dict.fromkeys([*data.notes, *filter(None, [period_remark(data)])])),
    }


def _say(summary: dict[str, Any]) -> None:
    records, band = summary["records"], summary["excited_hz"]
    periodic = f"periods of {summary['period_samples']} samples" if summary["period_samples"] else "not periodic"
    excited = "" if band is None else f", excited {band[0]:g} to {band[1]:g} Hz"
    rest = ", from rest" if summary["at_rest"] and not summary["period_samples"] else ""
    many = "1 record" if len(records) == 1 else f"{len(records)} records"
    print(f"{many} at {summary['sample_rate_hz']:g} Hz, {periodic}{rest}{excited}")
    print_rows(
        summary["channels"],
        *(Column(key, heading) for key, heading in (("name", "channel"), ("role", "role"), ("unit", "unit"))),
        *(
            Column(key, heading, "", ".4g")
            for key, heading in (("rms", "RMS"), ("largest", "largest"), ("mean", "mean"))
        ),
    )
    print_rows(
        records,
        Column("name", "record"),
        Column("samples", "samples"),
        Column("periods", "periods", "", ".0f"),
        Column("duration_s", "s", "", ".4g"),
    )


TABLE = Table(_summarise, _say)


_MOST_CHANNELS, _MOST_LEVELS = 6, 8
"""Largest numbers of channels and levels that are drawn; chosen for legibility."""
_SEGMENT = 4096
"""Samples of a segment of Welch's method; chosen."""
_THIN = 0.7
"""Width of lines, points; chosen."""


def draw_time_data(page: Figure, data: TimeRecords) -> None:
    """Draw the first record of each level: extremes over time on the left, on the right amplitudes of the lines of a period.

    Of records that are not periodic the right shows the amplitude spectral density. The first six channels and at most eight
    levels are drawn; the title counts what is left out.
    """
    levels = data.levels()
    spread = np.unique(np.linspace(0, len(levels) - 1, min(len(levels), _MOST_LEVELS)).round().astype(int))
    chosen = [list(levels.values())[i].records[0] for i in spread]
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
