"""TDMS files of LabVIEW, by the package npTDMS: channels as ``group/channel``."""

from pathlib import Path
from typing import Any

import numpy as np


def read_tdms(path: Path) -> dict[str, Any]:
    """Return the channels with numbers by ``group/channel``, and by the same names their rates, beginnings and units.

    Raises ImportError without npTDMS, ValueError or errors of npTDMS if the file cannot be read.
    """
    from nptdms import TdmsFile

    out: dict[str, Any] = {}
    rates: dict[str, float] = {}
    starts: dict[str, float] = {}
    units: dict[str, str] = {}
    with TdmsFile.open(path) as file:
        for group in file.groups():
            for channel in group.channels():
                if np.dtype(channel.dtype).kind not in "biuf" or not len(channel):
                    continue
                name = f"{group.name}/{channel.name}"
                out[name] = np.asarray(channel[:])
                told = channel.properties
                step = told.get("wf_increment")
                if isinstance(step, float) and step > 0.0:
                    rates[name] = 1.0 / step
                if isinstance(start := told.get("wf_start_offset"), float):
                    starts[name] = start
                unit = told.get("unit_string") or told.get("NI_UnitDescription")
                if isinstance(unit, str) and unit:
                    units[name] = unit
    if not out:
        raise ValueError("it holds no channel of numbers")
    return {**out, "__rates_hz__": rates, "__starts_s__": starts, "__file_units__": units}
