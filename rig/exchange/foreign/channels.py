"""WAV, TDMS (by the package npTDMS) and MDF 4 (by the package asammdf): channels of numbers by name.

Every reader raises errors of its package, or ValueError, if a file cannot be read, and ImportError without its package.
"""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.mapping import even_sampling
from rig.exchange.file_data import ChannelFacts, FileData

if TYPE_CHECKING:
    from asammdf.blocks import v2_v3_blocks, v4_blocks

    Channel = v2_v3_blocks.Channel | v4_blocks.Channel

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
    with TdmsFile.open(path) as file:
        for channel in (channel for group in file.groups() for channel in group.channels()):
            if np.dtype(channel.dtype).kind not in "biuf" or not len(channel):
                continue
            properties = channel.properties
            step, start = properties.get("wf_increment"), properties.get("wf_start_offset")
            unit = properties.get("unit_string") or properties.get("NI_UnitDescription")
            facts = ChannelFacts(
                name=str(channel.name),
                unit=unit if isinstance(unit, str) else "",
                sample_rate_hz=1.0 / step if isinstance(step, float) and step > 0.0 else None,
                start_s=start if isinstance(start, float) else None,
            )
            found[f"{channel.group_name}/{channel.name}"] = np.asarray(channel[:]), facts
    return _data(found)


def read_mdf4(path: Path) -> FileData:
    """Return the channels by name, with their rates, start times and units.

    A name that several groups have is followed by ``#`` and the number of the group, from 0. Instants that are not evenly
    spaced give no rate. Channels that are converted by a formula are left out: the formula would be evaluated.
    """
    from asammdf import MDF

    found: Found = {}
    with MDF(path) as file:
        if not str(file.version).startswith("4"):
            raise ValueError(f"it is of MDF version {file.version}, allowed is 4")
        groups: list[list[Channel]] = [[*group.channels] for group in file.groups]
        every = [channel.name for channels in groups for channel in channels]
        for number, channels in enumerate(groups):
            for index, channel in enumerate(channels):
                if index == file.masters_db.get(number) or _by_formula(channel):
                    continue
                signal = file.get(channel.name, group=number, index=index, ignore_invalidation_bits=True)
                samples = np.asarray(signal.samples)
                if samples.dtype.kind not in "biuf" or samples.ndim != 1 or samples.size < 2:
                    continue
                even = even_sampling(signal.timestamps)
                facts = ChannelFacts(
                    name=channel.name,
                    unit=str(signal.unit or ""),
                    sample_rate_hz=None if even is None else even.rate_hz,
                    start_s=None if even is None else even.start_s,
                    unread="" if even is not None else "is not evenly sampled; resample it",
                )
                called = channel.name if every.count(channel.name) == 1 else f"{channel.name}#{number}"
                found[called] = samples, facts
    return _data(found)


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
