"""Time data of somebody else as records, as a mapping describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.periodicity import check_periods, period_remark
from identification.experiments.time_experiments import resampled_periods
from identification.experiments.time_records import TimeRecord, TimeRecords
from identification.mapping.base import entries_at, in_si, notes_of, value_at
from identification.mapping.instants import EvenSampling
from identification.mapping.sampling import (
    WHOLE,
    check_rates_beside,
    common_rate_hz,
    instants_at,
    rates_of_file,
    seconds_of_time,
    start_of_file_s,
)
from identification.mapping.series import common_length, series
from identification.mapping.time_data import SampledChannel, Stretch, TimeDataMapping
from identification.signals.decimation import EDGE_SAMPLES, decimated
from vibrolock.arrays import Float

_ONE_LEVEL = 1.15
"""Largest ratio of the force's RMS of a record to the next smaller one of the same level: realisations scatter by less."""


def map_time_data(data: Any, mapping: TimeDataMapping, files: Mapping[str, Any] | None = None) -> TimeRecords:
    """Return the records in ``data`` in SI units.

    Raises `IdentificationError` if a path does not exist, dimensions or lengths do not fit the axes, sample rates
    disagree, sampling is uneven, values are NaN, no whole period or sample is left, or periods of the input differ.

    A channel that began later than others by whole samples is lined up with them, and all are cut to the common length.
    Periodic records are cut to whole periods and resampled without error, others filtered and decimated.

    Parameters
    ----------
    data
        Nested dictionaries, lists and arrays. At the top, ``sample_rate_hz`` (float), or ``__rates_hz__`` and
        ``__starts_s__`` (by path), tell what the file says of its own sampling.
    mapping
        What is where, and what it means.
    files
        Data of the further files that channels name.
    """
    every = {"": data, **(files or {})}
    entries = {name: entries_at(one, mapping.records, "records") for name, one in every.items()}
    counts = {name: len(some) for name, some in entries.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name or 'the file'} {count}" for name, count in counts.items())
        raise IdentificationError(f"records '{mapping.records}': unequal numbers ({told})")
    raw: list[_Raw] = []
    for number in range(counts[""]):
        where = f"{mapping.records}[{number}], " if mapping.records else ""
        raw += _raw_records({name: some[number] for name, some in entries.items()}, every, mapping, where)
    rate = raw[0].rate_hz
    if any(abs(record.rate_hz / rate - 1.0) > 1e-6 for record in raw):
        reason = f"records have rates from {rate:g} Hz on"
        raise IdentificationError(reason, field="sample_rate_hz", hint="wanted is one")
    for one in every.values():
        check_rates_beside(one, rate)
    cut, notes = _cut(raw, mapping, rate)
    if rounded_s := max(record.rounded_s for record in raw):
        notes = (f"the instants are rounded by up to {rounded_s:.2g} s; {rate:.10g} Hz was taken", *notes)
    channels, _ = in_si(mapping.channels)
    forces = [row for row, channel in enumerate(channels) if channel.role == "force"]
    force, unit = forces[:1], channels[forces[0]].unit if forces else ""
    if force and not any("level" in mapping.axes_of(channel) for channel in mapping.channels):
        cut = _grouped(cut, force[0], mapping.levels)
    ahead = max(mapping.transient_periods, 1) if mapping.ahead_periods is None else mapping.ahead_periods
    new_rate = rate if mapping.new_rate_hz is None else mapping.new_rate_hz
    size = round(cut[0].period_samples * (new_rate / rate)) if mapping.is_periodic else 0
    bottom, top = mapping.lowest_hz, mapping.highest_hz
    records = _named(cut, mapping, force, unit)
    levels = {one.level for one in records}
    if mapping.levels is None and not mapping.stretches and force and len(levels) > 1:
        sizes = f"{min(levels):.4g} to {max(levels):.4g} {unit}"
        notes = (*notes, f"{len(levels)} levels by the RMS of the force, {sizes}; the key `levels` tells others")
    found = TimeRecords(
        channels=channels,
        sample_rate_hz=new_rate,
        records=records,
        period_samples=size,
        ahead_periods=ahead,
        at_rest=mapping.at_rest,
        excited_hz=None if bottom is None or top is None else (bottom, top),
        instrument=mapping.instrument,
        specimen=mapping.specimen,
        source=mapping.source,
        notes=(*(note for one in every.values() for note in notes_of(one)), *notes),
    )
    check_periods(found)
    remark = period_remark(found)
    return replace(found, notes=(*found.notes, remark)) if remark else found


@dataclass(frozen=True, eq=False)
class _Raw:
    """One record as stored, in SI."""

    samples: Float
    rate_hz: float
    group: int
    period_samples: int
    level: float | None = None
    rounded_s: float = 0.0


def _raw_records(
    entries: Mapping[str, Any], files: Mapping[str, Any], mapping: TimeDataMapping, where: str
) -> list[_Raw]:
    """Return the records in one structure: all channels side by side, on one grid of instants."""
    _, factors = in_si(mapping.channels)
    instants: dict[tuple[str, float | None], EvenSampling] = {}
    found, told, starts, rounded_s = [], {"sample_rate_hz": mapping.sample_rate_hz}, [], 0.0
    for channel, factor in zip(mapping.channels, factors, strict=True):
        label = f"{where}channels.{channel.name}"
        stored = series(
            value_at(entries[channel.file], channel.value, label), mapping.axes_of(channel), channel.index, label
        )
        offset = 0.0 if channel.offset == "mean" else channel.offset
        found.append(replace(stored, values=(stored.values - offset) * (channel.scale * factor)))
        rates, start, rounded = _sampling(entries[channel.file], files[channel.file], mapping, channel, instants)
        told |= rates
        starts.append(start)
        rounded_s = max(rounded_s, rounded)
    rate = common_rate_hz(told)
    skipped = _skipped(mapping.channels, starts, rate)
    periods = {one.period_samples for one in found} - {0}
    if len(periods) > 1 or (periods and mapping.period_samples not in (None, *periods)):
        lengths = ", ".join(map(str, sorted({*periods, mapping.period_samples or 0} - {0})))
        reason = f"disagree ({lengths}), expected one length of a period"
        raise IdentificationError(reason, where=where, field="period_samples")
    together = common_length(
        [one.values for one in found],
        skipped,
        {c.name: one.values.shape for c, one in zip(mapping.channels, found, strict=True)},
        cut=any(skipped) or any(channel.file for channel in mapping.channels),
    )
    size = next(iter(periods), mapping.period_samples or 0)
    levels, realisations = together.shape[1:3]
    return [
        _Raw(together[:, level, one], rate, level, size, rounded_s=rounded_s)
        for level in range(levels)
        for one in range(realisations)
    ]


def _sampling(
    entry: Any,
    file: Any,
    mapping: TimeDataMapping,
    channel: SampledChannel,
    instants: dict[tuple[str, float | None], EvenSampling],
) -> tuple[dict[str, float | None], float, float]:
    """Return the sample rates told of a channel, by where they are from, its first instant, and the rounding of instants, s.

    ``instants`` holds the sampling of the instants that were judged for other channels, by file and wanted rate.
    """
    told = rates_of_file(file, [channel.value], channel.file or "file")
    start, rounded_s = start_of_file_s(file, channel.value), 0.0
    if mapping.time is not None and _holds(entry, mapping.time, alone=not channel.file):
        wanted = next((rate for rate in (mapping.sample_rate_hz, *told.values()) if rate is not None), None)
        found = instants.get((channel.file, wanted))
        if found is None:
            found = instants_at(entry, mapping.time, seconds_of_time(file, mapping.time_unit), wanted)
            instants[channel.file, wanted] = found
        told[f"time{' of ' if channel.file else ''}{channel.file}"] = found.rate_hz
        start, rounded_s = start + found.start_s, found.rounded_s
    return told, start, rounded_s


def _holds(entry: Any, path: str, *, alone: bool) -> bool:
    """Return whether an entry has the instants; a further file may leave them out."""
    if alone:
        return True
    try:
        value_at(entry, path, "time")
    except IdentificationError:
        return False
    return True


def _skipped(channels: Sequence[SampledChannel], starts: Sequence[float], rate_hz: float) -> list[int]:
    """Return how many samples of each channel are left out at the beginning, so that all begin at one instant."""
    late = (max(starts) - np.array(starts)) * rate_hz
    for channel, samples in zip(channels, late, strict=True):
        if abs(samples - round(samples)) > WHOLE:
            reason = f"begins {samples:.2f} samples before another"
            hint = "resample it, or say `against_file = true` at the top if the start times are wrong"
            raise IdentificationError(reason, field=f"channels.{channel.name}", allowed="whole samples", hint=hint)
    return [round(samples) + channel.start_samples for channel, samples in zip(channels, late, strict=True)]


def _cut(raw: Sequence[_Raw], mapping: TimeDataMapping, rate_hz: float) -> tuple[list[_Raw], tuple[str, ...]]:
    """Return the stretches of all records at the new rate, of periodic records the settled whole periods."""
    ratio = 1.0 if mapping.new_rate_hz is None else mapping.new_rate_hz / rate_hz
    if ratio > 1.0 + 1e-9:
        reason = f"the data has {rate_hz:g} Hz"
        raise IdentificationError(reason, field="new_rate_hz", value=mapping.new_rate_hz, allowed="up to that")
    found, left, groups = [], 0, 1 + max(one.group for one in raw)
    for number, one in enumerate(raw, 1):
        samples, first = one.samples, 0.0
        if not mapping.is_periodic and ratio < 1.0:
            samples, first = _decimated(samples, rate_hz, rate_hz * ratio, mapping.at_rest, f"record {number}")
        for begin, end, which in _stretches(mapping.stretches, one.samples.shape[1], rate_hz, number):
            if mapping.is_periodic:
                part, rest = _whole_periods(
                    samples[:, begin:end], one.period_samples, mapping.transient_periods, number
                )
                left = max(left, rest)
                part = resampled_periods(part, one.period_samples, rate_hz, rate_hz * ratio).reshape(len(part), -1)
            else:
                low, high = (max(int(np.ceil(at * ratio - first - 1e-9)), 0) for at in (begin, end))
                part = samples[:, low:high]
            if not part.shape[1]:
                raise IdentificationError(f"record {number}: no sample is left of it after the cuts")
            for row, channel in enumerate(mapping.channels):
                if channel.offset == "mean":
                    part[row] -= part[row].mean()
            level = mapping.stretches[which].level if mapping.stretches else None
            group = one.group if level is None else groups + which
            found.append(_Raw(part, rate_hz * ratio, group, one.period_samples, level))
    notes = (f"{left} samples at the end of a record are not a whole period and were left out",) if left else ()
    return found, notes


def _stretches(stretches: Sequence[Stretch], size: int, rate_hz: float, number: int) -> list[tuple[int, int, int]]:
    found = []
    for which, one in enumerate(stretches or (Stretch(),)):
        begin = one.start_samples or 0 if one.start_s is None else round(one.start_s * rate_hz)
        length = one.samples if one.duration_s is None else round(one.duration_s * rate_hz)
        step = one.step_samples or length or 0
        for turn in range(one.repeat):
            at = begin + turn * step
            end = size if length is None else at + length
            if end > size or at >= end:
                reason = f"ends at sample {max(end, at)}, record {number} has {size} samples"
                raise IdentificationError(reason, field=f"stretches[{which}]")
            found.append((at, end, which))
    return found


def _decimated(samples: Float, rate_hz: float, new_hz: float, at_rest: bool, where: str) -> tuple[Float, float]:
    """Return the samples at the new rate without spoilt ends, and the number of new samples that were left out before them."""
    slow = decimated(samples, rate_hz, new_hz)
    first = 0 if at_rest else EDGE_SAMPLES
    if slow.shape[1] <= first + EDGE_SAMPLES:
        raise IdentificationError(f"{where} is too short for its filter", field="new_rate_hz", value=new_hz)
    return slow[:, first : slow.shape[1] - EDGE_SAMPLES], float(first)


def _whole_periods(samples: Float, size: int, transient: int, number: int) -> tuple[Float, int]:
    """Return the settled whole periods of a record, and the number of samples left out behind them."""
    periods, rest = divmod(samples.shape[1], size)
    if periods <= transient:
        raise IdentificationError(
            f"record {number}: has {samples.shape[1]} samples, needs more than {transient} periods of {size}, one to be left "
            "after the transient"
        )
    return samples[:, transient * size : periods * size].copy(), rest


def _grouped(cut: Sequence[_Raw], force: int, levels: Sequence[float] | None) -> list[_Raw]:
    """Return the records in groups of one level each, by the RMS of the force, unless ``levels`` are those of all records.

    Groups are numbered in the order of the given levels: the smallest level is that of the smallest force. A stretch with a
    level of its own keeps its group.
    """
    free = [index for index, one in enumerate(cut) if one.level is None]
    if len(free) < 2 or (
        levels is not None and len(levels) in (1, len(cut))
    ):  # which tell the level of each by themselves
        return list(cut)
    rms = np.array([np.sqrt(np.mean(cut[index].samples[force] ** 2)) for index in free])
    order = np.argsort(rms, kind="stable")
    rises = rms[order][1:] > _ONE_LEVEL * rms[order][:-1]
    rank = np.empty(len(free), np.int64)
    rank[order] = np.concatenate([[0], np.cumsum(rises)])
    if levels is not None and len(levels) == rank.max() + 1:
        rank = np.argsort(levels, kind="stable")[rank]
    out = list(cut)
    for index, group in zip(free, rank.tolist(), strict=True):
        out[index] = replace(cut[index], group=group - len(free))  # none of those of a stretch, which are 0 or above
    return out


def _named(cut: Sequence[_Raw], mapping: TimeDataMapping, force: Sequence[int], unit: str) -> tuple[TimeRecord, ...]:
    groups = sorted({one.group for one in cut})
    levels = mapping.levels
    if levels is not None and len(levels) not in (len(groups), len(cut)):
        reason = f"has {len(levels)} numbers, the data has {len(groups)} levels and {len(cut)} records; one for each"
        raise IdentificationError(reason, field="levels")
    records: list[TimeRecord] = []
    for number, one in enumerate(cut):
        alike = [other for other in cut if other.group == one.group]
        if one.level is not None:
            level, kind = one.level, ""
        elif levels is not None:
            level, kind = levels[groups.index(one.group) if len(levels) == len(groups) else number], ""
        else:
            squares = [np.mean(other.samples[list(force)] ** 2) for other in alike] if force else [np.nan]
            level, kind = float(f"{np.sqrt(np.mean(squares)):.6g}"), " RMS"
        before = sum(1 for other in records if other.level == level)
        at = "" if np.isnan(level) else f"{level:.4g} {unit}{kind}, " if unit != "1" else f"{level:.4g}{kind}, "
        what = "realisation" if mapping.is_periodic else "record"
        records.append(TimeRecord(samples=one.samples, name=f"{at}{what} {before + 1}", level=level))
    return tuple(records)
