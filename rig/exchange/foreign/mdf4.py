"""MDF 4 files of measurement systems, by the package asammdf: channels by name, each with the rate of its group.

Channels that are converted by a formula are left out: the formula would be evaluated.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.exchange.file_data import ChannelFacts, FileData, Value

if TYPE_CHECKING:
    from asammdf.blocks import v2_v3_blocks, v4_blocks

_FORMULA = 3  # type of a conversion by a formula (ASAM MDF 4.1, block CC)
_EVEN = 1e-3
"""Relative difference of a step from the mean up to which instants are even; chosen: that of time stamps in milliseconds."""


def read_mdf4(path: Path) -> FileData:
    """Return the channels with numbers by name, with their rates, start times and units.

    A name that several groups have is followed by ``#`` and the number of the group, from 0. Instants that are not evenly
    spaced give no rate. Raises ImportError without asammdf, ValueError or errors of asammdf if the file cannot be read.
    """
    from asammdf import MDF

    values: dict[str, Value] = {}
    channels: dict[str, ChannelFacts] = {}
    with MDF(path) as file:
        if not str(file.version).startswith("4"):
            raise ValueError(f"it is of MDF version {file.version}, allowed is 4")
        groups = [[channel.name for channel in group.channels] for group in file.groups]
        every = [name for names in groups for name in names]
        for group, names in enumerate(groups):
            master = file.masters_db.get(group)
            for index, name in enumerate(names):
                if index == master or _by_formula(file.groups[group].channels[index]):
                    continue
                signal = file.get(name, group=group, index=index, ignore_invalidation_bits=True)
                samples = np.asarray(signal.samples)
                if samples.dtype.kind not in "biuf" or samples.ndim != 1 or samples.size < 2:
                    continue
                called = name if every.count(name) == 1 else f"{name}#{group}"
                values[called] = samples
                steps = np.diff(signal.timestamps)
                step = float(np.mean(steps))
                even = step > 0.0 and bool(np.all(np.abs(steps - step) <= _EVEN * step))
                channels[called] = ChannelFacts(
                    name=name,
                    unit=str(signal.unit or ""),
                    sample_rate_hz=1.0 / step if even else None,
                    start_s=float(signal.timestamps[0]) if even else None,
                )
    if not values:
        raise ValueError("it holds no channel of numbers")
    return FileData(values=values, channels=channels)


def _by_formula(channel: "v2_v3_blocks.Channel | v4_blocks.Channel") -> bool:
    conversion = getattr(channel, "conversion", None)
    return conversion is not None and conversion.conversion_type == _FORMULA
