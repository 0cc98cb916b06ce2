"""MDF 4 files of measurement systems, by the package asammdf: channels by name, each with the rate of its group.

Channels that are converted by a formula are left out: the formula would be evaluated.
"""

from pathlib import Path
from typing import Any

import numpy as np

_FORMULA = 3
_EVEN = 1e-3


def read_mdf4(path: Path) -> dict[str, Any]:
    """Return the channels with numbers by name, and by the same names their rates, beginnings and units.

    A name that several groups have is followed by ``#`` and the number of the group, from 0. Instants that are not evenly
    spaced give no rate. Raises ImportError without asammdf, ValueError or errors of asammdf if the file cannot be read.
    """
    from asammdf import MDF

    out: dict[str, Any] = {}
    rates: dict[str, float] = {}
    starts: dict[str, float] = {}
    units: dict[str, str] = {}
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
                out[called] = samples
                steps = np.diff(signal.timestamps)
                step = float(np.mean(steps))
                if step > 0.0 and np.all(np.abs(steps - step) <= _EVEN * step):
                    rates[called], starts[called] = 1.0 / step, float(signal.timestamps[0])
                if signal.unit:
                    units[called] = str(signal.unit)
    if not out:
        raise ValueError("it holds no channel of numbers")
    return {**out, "__rates_hz__": rates, "__starts_s__": starts, "__file_units__": units}


def _by_formula(channel: Any) -> bool:
    conversion = getattr(channel, "conversion", None)
    return conversion is not None and conversion.conversion_type == _FORMULA
