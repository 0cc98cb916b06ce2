"""TDMS files of LabVIEW, by the package npTDMS: channels as ``group/channel``."""

from pathlib import Path

import numpy as np

from rig.exchange.file_data import ChannelFacts, FileData, Value


def read_tdms(path: Path) -> FileData:
    """Return the channels with numbers by ``group/channel``, with their rates, start times and units.

    Raises ImportError without npTDMS, ValueError or errors of npTDMS if the file cannot be read.
    """
    from nptdms import TdmsFile

    values: dict[str, Value] = {}
    channels: dict[str, ChannelFacts] = {}
    with TdmsFile.open(path) as file:
        for group in file.groups():
            for channel in group.channels():
                if np.dtype(channel.dtype).kind not in "biuf" or not len(channel):
                    continue
                name, properties = f"{group.name}/{channel.name}", channel.properties
                values[name] = np.asarray(channel[:])
                step, start = properties.get("wf_increment"), properties.get("wf_start_offset")
                unit = properties.get("unit_string") or properties.get("NI_UnitDescription")
                channels[name] = ChannelFacts(
                    name=str(channel.name),
                    unit=unit if isinstance(unit, str) else "",
                    sample_rate_hz=1.0 / step if isinstance(step, float) and step > 0.0 else None,
                    start_s=start if isinstance(start, float) else None,
                )
    if not values:
        raise ValueError("it holds no channel of numbers")
    return FileData(values=values, channels=channels)
