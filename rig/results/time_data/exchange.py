"""Samples over time of a recorded point, and conversion of time data and sweeps for other formats."""

from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict

from identification import Channel
from rig.campaigns.evaluation.point import point_name
from rig.results.arrays import Arrays, Attributes
from rig.results.kind import Exchange
from rig.results.time_data.series import TimeData
from rig.text.contents import Array, Contents


def named(channels: Sequence[Channel]) -> tuple[Array, tuple[tuple[str, ...]], list[dict[str, str]]]:
    """Return units, labels and description of channels."""
    units = np.array([channel.unit for channel in channels])
    return units, (tuple(channel.name for channel in channels),), [dict(vars(channel)) for channel in channels]


def time_data_parts(data: TimeData) -> Contents:
    """Convert time data to samples with their instants."""
    units, labels, channels = named(data.channels)
    attributes = {
        "channels": channels,
        "sample_rate_hz": data.sample_rate_hz,
        "start_s": data.start_s,
        "point": data.point,
        "specimen": data.specimen,
    }
    return Contents(
        kind="time-data",
        title=f"{data.specimen}, {point_name(data.point)}",
        arrays={
            "time_s": data.start_s + np.arange(data.samples.shape[1]) / data.sample_rate_hz,
            "samples": data.samples,
        },
        attributes=attributes,
        rows={"time_s": 0, "samples": 1},
        units={"samples": units},
        labels={"samples": labels},
    )


class _TimeDataFacts(BaseModel):
    """Attributes of time data."""

    model_config = ConfigDict(extra="forbid")

    channels: tuple[Channel, ...]
    sample_rate_hz: float
    start_s: float = 0.0
    point: int = 0
    specimen: str = ""


def time_data_from(arrays: Arrays, attributes: Attributes) -> TimeData:
    """Convert the output of `time_data_parts` back; raise KeyError or ValueError for missing or unknown entries."""
    facts = _TimeDataFacts.model_validate(attributes)
    return TimeData(samples=np.asarray(arrays["samples"]), **dict(facts))


EXCHANGE = Exchange("time-data", TimeData, time_data_parts, time_data_from)
