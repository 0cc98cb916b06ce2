"""Cut records into one block for each hit, take offsets out, and judge every hit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.channels import Channel, find_role
from identification.errors import IdentificationError
from identification.hammer.faults import double_hit, overloaded
from identification.hammer.hits import Pulse, found_pulses, noise_rms
from identification.hammer.result import Hit
from vibrolock.arrays import Float

_APART_S = 0.25
"""Hits that follow within this time are bounces of one: nobody hits twice on purpose as quickly."""
_BEFORE = 0.05
"""Part of a record that lies before its hit, where it is not given. Chosen."""
_SHORTEST = 64
"""Fewest samples in the record of a hit. Chosen."""
_MOVING, _QUIETEST = 0.05, 3.0
"""A structure still moves if its motion before the hit is this share of that after it, and so many times the quietest one."""


@dataclass(frozen=True, eq=False)
class Block:
    """The record of one hit."""

    samples: Float
    """float[n_channels, n], without offset; zeros after the end of a record that is too short."""
    before: int
    """Number of samples before the hit."""
    pulse: Pulse
    """The pulse of the force, in samples of the block."""
    noise_rms: Float
    """float[n_channels], RMS before the hit."""
    hit: Hit
    """What is said of the hit."""


@dataclass(frozen=True)
class _Place:
    """Where a hit is: the number of its record, its pulses, and the samples that are free before and after it."""

    record: int
    pulses: tuple[Pulse, ...]
    free_before: int
    free_after: int


def blocks_of(
    records: Sequence[Float],
    channels: tuple[Channel, ...],
    rate: float,
    record_s: float | None,
    pretrigger_s: float | None,
    trigger_n: float | None,
    full_scale: Mapping[str, float],
) -> list[Block]:
    """Return the blocks of all hits; raise `IdentificationError` if there is no hit, or no room for a record."""
    force = find_role(channels, "force")
    forces = [record[force] - np.median(record[force]) for record in records]
    places = _places(found_pulses(forces, trigger_n, max(round(_APART_S * rate), 1)), [force.size for force in forces])
    before, length = _lengths(places, rate, record_s, pretrigger_s)
    cut = [_cut(records[place.record], force, place, before, length) for place in places]
    rest_rms = np.array([rms for _, _, rms in cut])
    quietest = np.min(rest_rms, axis=0)
    noise = max(noise_rms(f) for f in forces)
    blocks = []
    for number, (place, (samples, pulse, rms)) in enumerate(zip(places, cut, strict=True), start=1):
        hit = Hit(
            label=f"{number} (record {place.record + 1}, {place.pulses[0].first / rate:.3f} s)",
            record=place.record + 1,
            time_s=place.pulses[0].first / rate,
            peak_n=pulse.height_n,
            duration_s=pulse.width / rate,
        )
        shift = pulse.first - place.pulses[0].first
        others = [replace(p, first=p.first + shift, peak=p.peak + shift, end=p.end + shift) for p in place.pulses[1:]]
        raw = records[place.record][:, max(place.pulses[0].first - before, 0) :][:, :length]
        after = np.sqrt(np.mean(samples[:, pulse.first : pulse.first + max(length // 5, 1)] ** 2, axis=1))
        faults = (
            overloaded(raw, channels, full_scale),
            double_hit(samples[force, : min(length, pulse.first + place.free_after)], pulse, others, noise, rate),
            _too_short(place, before, length, rate),
            _still_moving(rms, quietest, after, channels, force),
        )
        fault = "; ".join(text for text in faults if text)
        blocks.append(Block(samples, before, pulse, rms, replace(hit, fault=fault)))
    return blocks


def _places(pulses: Sequence[Sequence[Sequence[Pulse]]], sizes: Sequence[int]) -> list[_Place]:
    places = []
    for record, groups in enumerate(pulses):
        begins = [group[0].first for group in groups]
        for index, group in enumerate(groups):
            end = begins[index + 1] if index + 1 < len(groups) else sizes[record]
            since = group[0].first - (begins[index - 1] if index else 0)
            places.append(_Place(record, tuple(group), since, end - group[0].first))
    return places


def _lengths(
    places: Sequence[_Place], rate: float, record_s: float | None, pretrigger_s: float | None
) -> tuple[int, int]:
    """Return the samples before each hit and of a whole block.

    Without a given length the block is as long as all hits but the shortest quarter allow.
    """
    if record_s is not None:
        length = round(record_s * rate)
    else:
        room = np.sort([place.free_after for place in places])
        length = int(room[len(room) // 4])
    first = min(place.free_before for place in places)
    before = min(round(_BEFORE * length), first) if pretrigger_s is None else round(pretrigger_s * rate)
    length = length if record_s is not None else length + before
    if length < _SHORTEST or before >= length // 2:
        reason = f"a record of a hit has {length} samples, {before} of them before it"
        raise IdentificationError(reason, field="record_s", allowed=f"{_SHORTEST} and at most half")
    return before, length


def _cut(record: Float, force: int, place: _Place, before: int, length: int) -> tuple[Float, Pulse, Float]:
    """Return the block without offsets, its pulse, and the RMS float[n_channels] before the hit."""
    first = place.pulses[0].first
    begin = max(first - before, 0)
    kept = record[:, begin : begin + length]
    samples = np.zeros((record.shape[0], length))
    rest = record[:, begin : max(first - 1, begin + 1)] if first > begin + 8 else None
    offset = np.median(record, axis=1) if rest is None else np.mean(rest, axis=1)
    samples[:, : kept.shape[1]] = kept - offset[:, None]
    pulse = place.pulses[0]
    moved = Pulse(pulse.first - begin, pulse.peak - begin, min(pulse.end - begin, length), pulse.height_n)
    rms = np.zeros(record.shape[0]) if rest is None else np.std(rest, axis=1)
    return samples, moved, rms


def _too_short(place: _Place, before: int, length: int, rate: float) -> str:
    left = place.free_after - (length - before)
    if left >= 0 and place.free_before >= before:
        return ""
    if left < 0:
        needed = (length - before) / rate
        return f"cut short: {place.free_after / rate:.3g} s until the next hit or the end, needs {needed:.3g} s"
    return f"cut short: {place.free_before / rate:.3g} s before the hit, needs {before / rate:.3g} s"


def _still_moving(rms: Float, quietest: Float, after: Float, channels: tuple[Channel, ...], force: int) -> str:
    share = rms / np.maximum(after, 1e-300)
    moving = (share > _MOVING) & (rms > _QUIETEST * quietest)
    moving[force] = False
    if not moving.any():
        return ""
    worst = int(np.argmax(np.where(moving, share, 0.0)))
    return f"still moving: {channels[worst].name} has {100 * share[worst]:.2g} % of its motion before the hit"
