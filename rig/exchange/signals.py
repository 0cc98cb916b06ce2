"""Time data and sweeps, taken apart and put together."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification import Channel, Transient
from rig.campaigns.evaluation.point import point_name
from rig.exchange.time_data import TimeData
from rig.measurements.contents import Contents

__all__ = ["time_data_from", "time_data_parts", "transient_from", "transient_parts"]


def _named(channels: Sequence[Channel]) -> tuple[Any, tuple[tuple[str, ...]], list[dict[str, str]]]:
    """Units, labels and description of channels."""
    units = np.array([channel.unit for channel in channels])
    return units, (tuple(channel.name for channel in channels),), [dict(vars(channel)) for channel in channels]


def time_data_parts(data: TimeData) -> Contents:
    """Samples with their instants."""
    units, labels, channels = _named(data.channels)
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


def time_data_from(arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> TimeData:
    """Inverse of `time_data_parts`; KeyError or TypeError on what is missing or unknown."""
    rest = dict(attributes)
    channels = tuple(Channel(**channel) for channel in rest.pop("channels"))
    return TimeData(channels, np.asarray(arrays["samples"]), **rest)


def transient_parts(transient: Transient) -> Contents:
    """Fundamentals over time."""
    units, labels, channels = _named(transient.channels)
    return Contents(
        kind="sweep",
        title="sweep",
        arrays={name: getattr(transient, name) for name in ("time_s", "frequency_hz", "fundamentals")},
        attributes={"channels": channels, "window_periods": transient.window_periods},
        rows={"time_s": 0, "frequency_hz": 0, "fundamentals": 1},
        units={"fundamentals": units},
        labels={"fundamentals": labels},
    )


def transient_from(arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> Transient:
    """Inverse of `transient_parts`; KeyError or TypeError on what is missing or unknown."""
    channels = tuple(Channel(**channel) for channel in attributes["channels"])
    time_s, frequency_hz, fundamentals = (arrays[name] for name in ("time_s", "frequency_hz", "fundamentals"))
    return Transient(channels, time_s, frequency_hz, fundamentals, int(attributes["window_periods"]))
