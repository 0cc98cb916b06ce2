"""Propose a mapping of time data for a file: look into it, guess, and write TOML with comments."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.mapping import CsvLayout, even_sampling
from rig.exchange.child_reading import ImportFailed, read_in_child
from rig.exchange.file_data import MappingText
from rig.exchange.proposal.contents import FileContents, Leaf, contents_of
from rig.exchange.proposal.guesses import (
    band_of,
    dimensions,
    is_named_time,
    is_time,
    period_of,
    rate_in,
    role_of,
    transient_periods,
)
from rig.exchange.proposal.text import Proposal, ProposedChannel, text_of
from rig.exchange.sources import format_of, read_data
from rig.exchange.spellings import time_unit_in
from rig.exchange.tables.guess import guessed_layout
from vibrolock.quantities import seconds_in

_MIN_SAMPLES = 16  # samples of the shortest signal; chosen
_ONE_RATE = 1e-4  # relative difference of rates of instants as they are printed; chosen
_MAX_CHANNELS = 16  # channels that are proposed; chosen


def proposed_mapping(paths: Sequence[Path], format_: str = "", units: str = "") -> tuple[str, tuple[str, ...]]:
    """Return a mapping of time data, as text, and what is left to be filled in.

    ``paths`` are the file that will be imported, and others whose channels belong to the same records; ``format_`` is that
    of the first, by its ending if empty; ``units`` those of a universal file, see `rig.exchange.reading.import_file`. Raises
    `ImportFailed` if a file cannot be read, or holds no array long enough to be a signal.
    """
    for number, path in enumerate(paths):
        format_of(path, format_ if not number else "", "`format`")
    others = [str(path) for path in paths[1:]]
    found = read_in_child(
        "proposal", paths[0], "file of time data", MappingText, others=others, format_=format_, units=units
    )
    return found.text, tuple(found.missing)


def proposed(first: Path, others: Sequence[str], format_: str, units: str) -> MappingText:
    """Return text and what is missing, see `proposed_mapping`; in a child process, for what files hold may be large."""
    layout = None
    found: list[FileContents] = []
    paths = [first, *map(Path, others)]
    forms = [format_of(first, format_, "`format`"), *(format_of(path, "", "`format`") for path in paths[1:])]
    for number, (path, form) in enumerate(zip(paths, forms, strict=True)):
        if path.parent.resolve() != first.parent.resolve():
            raise ImportFailed(
                f"{path}: is in another folder than {first}; a mapping names files beside the one imported"
            )
        guessed = guessed_layout(path) if form == "csv" else None
        layout = layout or guessed
        found.append(contents_of(read_data(path, form, units=units, layout=guessed), path.name if number else ""))
    proposal = _proposal(found, first, layout)
    relative = {one.name if one != first else "" for one, form in zip(paths, forms, strict=True) if form == "wav"}
    return MappingText(text_of(proposal, found, [path.name for path in paths], relative), proposal.missing)


def _proposal(found: Sequence[FileContents], path: Path, layout: CsvLayout | None) -> Proposal:
    arrays = [leaf for contents in found for leaf in contents.arrays]
    lengths = [max(leaf.values.shape) for leaf in arrays if max(leaf.values.shape) >= _MIN_SAMPLES]
    if not lengths:
        raise ImportFailed(f"{path}: holds no array of real numbers with {_MIN_SAMPLES} samples or more")
    samples = max(set(lengths), key=lambda length: (lengths.count(length), length))  # the commonest, then the largest
    instants = [leaf for leaf in arrays if is_time(leaf.name, leaf.values, leaf.unit)]
    times = [replace(leaf, unit=leaf.unit or time_unit_in(leaf.path)) for leaf in instants]
    signals = [leaf for leaf in arrays if samples in leaf.values.shape and leaf not in instants]
    if not signals:
        raise ImportFailed(f"{path}: holds no signals: arrays of {_MIN_SAMPLES} samples and more besides the time")
    channels = _channels(signals, samples)
    rate, rate_from, time = _rate(found, times)
    force = next((c for c in channels if c.role == "force"), channels[0])
    period, transient, band, at_rest = _periods(force, channels, rate, samples)
    return Proposal(
        channels=tuple(channels[:_MAX_CHANNELS]),
        left_out=len(channels) - len(channels[:_MAX_CHANNELS]),
        records=found[0].records,
        rate_hz=rate,
        rate_from=rate_from,
        time=time,
        period_samples=period,
        transient_periods=transient,
        band_hz=band,
        at_rest=at_rest,
        layout=layout,
        missing=() if rate else ("sample_rate_hz",),
    )


def _channels(signals: Sequence[Leaf], samples: int) -> list[ProposedChannel]:
    plain = [leaf for leaf in signals if leaf.values.ndim == min(one.values.ndim for one in signals)]
    reference = next((leaf for leaf in plain if role_of(leaf.name, leaf.unit)[0] == "force"), plain[0])
    of_reference = dimensions(reference.values, samples)
    if len(signals) == 1 and reference.values.ndim == 2:  # the columns of the only array of a file are channels
        of_reference = ("sample", "channel") if reference.values.shape.index(samples) == 0 else ("channel", "sample")
    if len(reference.columns) > 1 and reference.values.ndim == 2:
        first = reference.values.shape[0] == len(reference.columns)
        of_reference = ("channel", "sample") if first else ("sample", "channel")
    known = dict(zip(of_reference, reference.values.shape, strict=True))
    found: list[ProposedChannel] = []
    for leaf in signals:
        axes = of_reference if leaf is reference else _like(leaf, known, samples)
        role, unit = role_of(leaf.name, leaf.unit)
        count = leaf.values.shape[axes.index("channel")] if "channel" in axes else 1
        for index in range(1, count + 1):
            if len(leaf.columns) == count > 1:
                role, unit = role_of(leaf.name, leaf.columns[index - 1])
            name = leaf.name if count == 1 else f"{leaf.name}{index}"
            found.append(ProposedChannel(leaf, name, role, unit, axes, index))
    names = [channel.name for channel in found]
    return _with_roles(
        [
            channel if names.count(channel.name) == 1 else replace(channel, name=f"{channel.name}_{number}")
            for number, channel in enumerate(found, 1)
        ]
    )


def _like(leaf: Leaf, known: dict[str, int], samples: int) -> tuple[str, ...]:
    """Return the axes of an array whose dimensions of other lengths than those of the reference are channels."""
    if leaf.values.shape == tuple(known.values()):
        return tuple(known)
    left, names = dict(known), []
    for length in leaf.values.shape:
        name = next((name for name, size in left.items() if size == length), "channel")
        left.pop(name, None)
        names.append(name)
    return tuple(names) if len(set(names)) == len(names) and "sample" in names else dimensions(leaf.values, samples)


def _with_roles(channels: Sequence[ProposedChannel]) -> list[ProposedChannel]:
    """Return the channels with one force and one drive point at most, and a role for each. One alone is a motion.

    Without a force, one whose unit in the file does not say otherwise is taken for it.
    """
    out = list(channels)
    able = [i for i, c in enumerate(out) if not c.leaf.unit or c.played("force").unit == c.unit]
    if len(out) > 1 and able and not any(channel.role == "force" for channel in out):
        at = next((i for i in able if out[i].role == "monitor"), None)
        if at is None:  # by the names: V1 before V2
            open_ = [i for i in able if not out[i].role] or able
            at = min(open_, key=lambda i: out[i].name)
        out[at] = out[at].played("force")
    forces = [number for number, channel in enumerate(out) if channel.role == "force"]
    motions = [number for number, channel in enumerate(out) if channel.role == "motion"]
    motions += [number for number, channel in enumerate(out) if not channel.role]
    roles = {**dict.fromkeys(forces[1:], "monitor"), **dict.fromkeys(motions, "response")}
    roles |= dict.fromkeys(motions[:1], "drive")
    return [channel.played(roles.get(number, channel.role)) for number, channel in enumerate(out)]


def _rate(found: Sequence[FileContents], times: Sequence[Leaf]) -> tuple[float | None, str, Leaf | None]:
    """Return the sample rate, where it is from (empty: the file tells it), and the instants, if these tell it."""
    if found[0].rate_hz is not None:
        return found[0].rate_hz, "", None
    _check_clocks(times)
    for leaf in times:
        if (even := even_sampling(leaf.values, seconds_in(leaf.unit) or 1.0)) is not None:
            return even.rate_hz, "", leaf
    for contents in found:
        beside = contents.beside.single if contents.beside is not None else {}
        if (named := rate_in({**contents.single, **beside})) is not None:
            return named[1], named[0], None
    return None, "", None


def _check_clocks(times: Sequence[Leaf]) -> None:
    """Raise `ImportFailed` if a file holds instants of several rates: a mapping takes one."""
    named = [leaf for leaf in times if is_named_time(leaf.name, leaf.unit) and not leaf.file]
    told = {leaf.path: even_sampling(leaf.values, seconds_in(leaf.unit) or 1.0) for leaf in named}
    rates = {path: even.rate_hz for path, even in told.items() if even is not None}
    first = next(iter(rates.items()), None)
    for path, rate in rates.items():
        if first is not None and abs(rate / first[1] - 1.0) > _ONE_RATE:
            raise ImportFailed(
                f"the instants '{first[0]}' have {first[1]:.6g} Hz, '{path}' have {rate:.6g} Hz, and a mapping takes those of "
                "one rate; save the channels of each as a file"
            )


def _periods(
    force: ProposedChannel, channels: Sequence[ProposedChannel], rate: float | None, samples: int
) -> tuple[int, int, tuple[float, float] | None, bool]:
    """Return samples of a period (0: in the axes, or none), transient periods, excited band, whether all begins at rest.

    A motion without a force is taken for a decay, which has no period although it seems to repeat.
    """
    records = [_first_record(channel) for channel in channels]
    signal = _first_record(force)
    in_axes = "period" in force.axes
    size = samples if in_axes else period_of(signal) if force.role == "force" else 0
    if not size:
        # At rest: the first hundredth of each record has less than a hundredth of its largest value.
        rest = all(np.abs(x[: max(x.size // 100, 2)]).max() <= 0.01 * np.abs(x).max() for x in records)
        return 0, 0, None, bool(rest)
    whole = signal.size // size
    longest = max(
        transient_periods(record[: whole * size].reshape(whole, size)) if whole > 1 else 0 for record in records
    )
    band = band_of(signal[(whole - 1) * size : whole * size], rate) if rate else None
    return 0 if in_axes else size, longest, band, False


def _first_record(channel: ProposedChannel) -> NDArray[np.float64]:
    """Return the first record of a channel, its periods one after the other."""
    values, names = channel.leaf.values.astype(np.float64), list(channel.axes)
    for name, index in (("channel", channel.index - 1), ("realisation", 0), ("level", -1)):
        if name in names:
            values = np.take(values, index, axis=names.index(name))
            names.remove(name)
    if "period" in names:
        values = np.moveaxis(values, names.index("period"), 0)
    return np.asarray(values.reshape(-1))
