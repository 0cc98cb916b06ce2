"""WAV, TDMS (by the package npTDMS) and MDF 4 (by the package asammdf): channels of numbers by name.

Every reader raises errors of its package, or ValueError, if a file cannot be read, and ImportError without its package.
"""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from identification.mapping import even_sampling
from rig.exchange.file_data import ChannelFacts, FileData, Value
from rig.exchange.spellings import UNIT_KEYS, factor_remark, number_in, plain, rate_named
from vibrolock.quantities import says_a_unit, seconds_in

if TYPE_CHECKING:
    from asammdf import Signal
    from asammdf.blocks import v2_v3_blocks, v4_blocks

    Channel = v2_v3_blocks.Channel | v4_blocks.Channel

_SCALE_KIND = re.compile(r"NI_Scale\[\d+\]_Scale_Type$")
_SCALES = (
    *("Polynomial", "Linear", "RTD", "Strain", "Table", "Thermistor", "Thermocouple", "Add", "Subtract", "AdvancedAPI"),
)
"""Kinds of scales that npTDMS applies (version 1.13)."""
_TIME = (0, 1)  # types of a master channel that is time: none said, or time (ASAM MDF 4.1, block CN)
_FROM_1904_S = 2_082_844_800  # from the origin of time stamps of TDMS, 1904, to 1970
_ONE_RATE = 1e-4  # relative difference of rates as they are printed; chosen
_FORMULA = 3  # type of a conversion by a formula (ASAM MDF 4.1, block CC)
Found = dict[str, tuple[NDArray[np.generic], ChannelFacts]]
"""Values and facts of channels by name."""


def read_wav(path: Path) -> FileData:
    """Return ``channel1``, ``channel2``, ... as float[n], 1 at full scale, and the sample rate."""
    from scipy.io import wavfile

    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        rate, samples = wavfile.read(path)
    if early := next((str(one.message) for one in warned if "EOF" in str(one.message)), None):
        raise ValueError(f"it is cut short: {early}")
    if samples.dtype.kind == "u":
        values = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == "i":
        values = samples / float(2 ** (8 * samples.dtype.itemsize - 1))
    else:
        values = samples.astype(np.float64)
    columns = values[:, None] if values.ndim == 1 else values
    channels = {f"channel{number}": np.array(column) for number, column in enumerate(columns.T, 1)}
    return FileData(values={**channels}, sample_rate_hz=float(rate))


def read_tdms(path: Path) -> FileData:
    """Return the channels by ``group/channel``, with their rates, start times and units."""
    from nptdms import TdmsFile

    found: Found = {}
    begins: dict[str, Fraction] = {}
    with TdmsFile.open(path, raw_timestamps=True) as file:
        for channel in (channel for group in file.groups() for channel in group.channels()):
            if np.dtype(channel.dtype).kind not in "biuf" or not len(channel):
                continue
            full = f"{channel.group_name}/{channel.name}"
            every = (channel.properties, file[channel.group_name].properties, file.properties)
            found[full] = np.asarray(channel[:]), _facts_of_tdms(str(channel.name), every)
            if (begin := _instant(channel.properties.get("wf_start_time"))) is not None:
                begins[full] = begin
    first = min(begins.values(), default=Fraction(0))
    later = {name: float(begin - first) for name, begin in begins.items()}
    lined_up = {
        name: (values, replace(facts, start_s=(facts.start_s or 0.0) + later[name]) if name in later else facts)
        for name, (values, facts) in found.items()
    }
    return replace(_data(lined_up), begins_s=float(first) if begins else None)


def _facts_of_tdms(name: str, every: Sequence[Mapping[str, object]]) -> ChannelFacts:
    """Return what the properties of a channel say, and those of its group and file: of rates, units and scales."""
    properties = cast("Sequence[Mapping[str, Value]]", every)
    start = properties[0].get("wf_start_offset")
    unit = next((unit for key in UNIT_KEYS for one in properties[:2] if (unit := _text_at(one, key))), "")
    of_time = next((one["wf_xunit_string"] for one in properties if one.get("wf_xunit_string")), "")
    seconds = seconds_in(of_time) if isinstance(of_time, str) and says_a_unit(of_time) else 1.0
    step = next((step for one in properties if (step := number_in(one.get("wf_increment"))) and step > 0.0), None)
    rates = {"wf_increment": 1.0 / (step * seconds)} if step and seconds else {}
    for key, value in (pair for one in properties for pair in one.items() if pair[0] != "wf_increment"):
        if (rate := rate_named(key, value)) is not None:
            rates.setdefault(key, rate)
    remarks = [f"has a waveform over {of_time!s}, which is not a unit of time"] if step and seconds is None else []
    if rates and max(rates.values()) / min(rates.values()) - 1.0 > _ONE_RATE:
        remarks.append(f"has several rates ({', '.join(f'{key} {rate:g} Hz' for key, rate in rates.items())})")
    remarks += [f"is scaled by {kind}, which npTDMS does not know" for kind in _unknown_scales(every)]
    remarks += [remark for key, value in properties[0].items() if (remark := factor_remark(key, value, "the property"))]
    return ChannelFacts(
        name=name,
        unit=unit,
        sample_rate_hz=next(iter(rates.values()), None),
        start_s=start * (seconds or 1.0) if isinstance(start, float) else None,
        unread="; ".join(remarks),
    )


def _text_at(properties: Mapping[str, Value], plain_key: str) -> str:
    """Return the text of the property with a key, however it is spelled, if it says a unit."""
    texts = (value for key, value in properties.items() if plain(key) == plain_key and isinstance(value, str))
    return next(filter(says_a_unit, texts), "")


def _unknown_scales(every: Sequence[Mapping[str, object]]) -> Iterator[str]:
    """Yield the kinds of scales that npTDMS leaves out: of the first of channel, group and file that has any."""
    for properties in every:
        kinds = [str(kind) for key, kind in properties.items() if _SCALE_KIND.match(key)]
        if kinds:
            unscaled = properties.get("NI_Scaling_Status", "unscaled") != "scaled"
            yield from (kind for kind in kinds if unscaled and kind not in _SCALES)
            return


def _instant(value: object) -> Fraction | None:
    """Return a time stamp of TDMS, s since 1970; None without one, or if it is at the origin of its clock: not set."""
    seconds, parts = getattr(value, "seconds", 0), getattr(value, "second_fractions", 0)
    return Fraction(int(seconds) - _FROM_1904_S) + Fraction(int(parts), 2**64) if seconds else None


def read_mdf4(path: Path) -> FileData:
    """Return the channels by name, with their rates, start times and units.

    A name that several groups have is followed by ``#`` and the number of the group, from 0. Instants that are not evenly
    spaced give no rate. Channels that are converted by a formula are left out: the formula would be evaluated.
    """
    from asammdf import MDF

    found: Found = {}
    left_out: dict[str, ChannelFacts] = {}
    with MDF(path) as file:
        if not str(file.version).startswith("4"):
            raise ValueError(f"it is of MDF version {file.version}, allowed is 4")
        groups: list[list[Channel]] = [[*group.channels] for group in file.groups]
        every = [channel.name for channels in groups for channel in channels]
        for number, channels in enumerate(groups):
            for index, channel in enumerate(channels):
                if index == file.masters_db.get(number):
                    continue
                called = channel.name if every.count(channel.name) == 1 else f"{channel.name}#{number}"
                if _by_formula(channel):
                    left_out[called] = ChannelFacts(unread="is converted by a formula, which is not evaluated")
                    continue
                signal = file.get(channel.name, group=number, index=index, ignore_invalidation_bits=True)
                samples = np.asarray(signal.samples)
                if samples.dtype.kind in "biuf" and samples.ndim == 1 and samples.size >= 2:
                    found[called] = samples, _facts_of_mdf(channel.name, signal)
        begins_s = file.header.abs_time * 1e-9
    data = _data(found)
    return replace(data, channels=data.channels | left_out, begins_s=begins_s or None)


def _facts_of_mdf(name: str, signal: "Signal") -> ChannelFacts:
    even = even_sampling(signal.timestamps)
    remarks = [] if even is not None else ["is not evenly sampled; resample it"]
    if signal.master_metadata is not None and signal.master_metadata[1] not in _TIME:
        remarks = [f"is sampled over '{signal.master_metadata[0]}', which is not a time"]
    if signal.invalidation_bits is not None and (invalid := int(np.count_nonzero(signal.invalidation_bits))):
        remarks.append(f"has {invalid} samples that are marked as invalid")
    return ChannelFacts(
        name=name,
        unit=str(signal.unit or ""),
        sample_rate_hz=None if even is None else even.rate_hz,
        start_s=None if even is None else even.start_s,
        unread="; ".join(remarks),
    )


def _by_formula(channel: "Channel") -> bool:
    conversion = getattr(channel, "conversion", None)
    return conversion is not None and conversion.conversion_type == _FORMULA


def _data(found: Found) -> FileData:
    if not found:
        raise ValueError("it holds no channel of numbers")
    return FileData(
        values={name: values for name, (values, _) in found.items()},
        channels={name: facts for name, (_, facts) in found.items()},
    )
