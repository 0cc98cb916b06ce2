"""Samples over time of a recorded point, and conversion of time data and sweeps for other formats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from identification import Channel, IdentificationError, TimeRecord, TimeRecords, Transient
from rig.campaigns.evaluation.point import point_name
from rig.text.contents import Array, Contents


@dataclass(frozen=True, eq=False)
class TimeData:
    """Evenly sampled signals.

    Parameters
    ----------
    channels
        One per row of ``samples``.
    samples
        float[n_channels, n], in the SI unit of each channel; NaN where samples were lost in transfer.
    sample_rate_hz
        Samples per second.
    start_s
        Time of the first sample.
    point
        Stored number of the point, from 0.
    specimen
        Name of the specimen.

    Raises
    ------
    IdentificationError
        If shapes do not agree, for inf, or for a rate that is not above zero.
    """

    channels: tuple[Channel, ...]
    samples: NDArray[np.floating]
    sample_rate_hz: float
    start_s: float = 0.0
    point: int = 0
    specimen: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        samples = np.asarray(self.samples)
        object.__setattr__(self, "samples", samples)
        if samples.ndim != 2 or samples.shape[0] != len(self.channels) or not samples.size:
            raise IdentificationError(f"samples: shape {samples.shape} for {len(self.channels)} channels")
        for channel, row in zip(self.channels, samples, strict=True):
            if np.any(np.isinf(row)):
                where = int(np.argmax(np.isinf(row)))
                raise IdentificationError(f"samples: channel '{channel.name}' is {row[where]} at [{where}]")
        if not (np.isfinite(self.sample_rate_hz) and self.sample_rate_hz > 0.0):
            raise IdentificationError(f"sample_rate_hz: is {self.sample_rate_hz:g} Hz, must be finite and above zero")


def series_of_records(records: TimeRecords) -> tuple[TimeData, ...]:
    """Return imported records as time data, one for each, numbered from 0."""
    return tuple(
        TimeData(records.channels, one.samples, records.sample_rate_hz, point=number, specimen=records.specimen)
        for number, one in enumerate(records.records)
    )


def records_of_series(data: TimeData) -> TimeRecords:
    """Return time data of this program as one record; raise `IdentificationError` for lost samples, which are NaN."""
    record = TimeRecord(samples=np.asarray(data.samples, np.float64), name=point_name(data.point))
    return TimeRecords(
        channels=data.channels, sample_rate_hz=data.sample_rate_hz, records=(record,), specimen=data.specimen
    )


def _named(channels: Sequence[Channel]) -> tuple[Array, tuple[tuple[str, ...]], list[dict[str, str]]]:
    """Return units, labels and description of channels."""
    units = np.array([channel.unit for channel in channels])
    return units, (tuple(channel.name for channel in channels),), [dict(vars(channel)) for channel in channels]


def time_data_parts(data: TimeData) -> Contents:
    """Convert time data to samples with their instants."""
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


class _TimeDataFacts(BaseModel):
    """Attributes of time data."""

    model_config = ConfigDict(extra="forbid")

    channels: tuple[Channel, ...]
    sample_rate_hz: float
    start_s: float = 0.0
    point: int = 0
    specimen: str = ""


def time_data_from(arrays: Mapping[str, Array], attributes: Mapping[str, object]) -> TimeData:
    """Convert the output of `time_data_parts` back; raise KeyError or ValueError for missing or unknown entries."""
    facts = _TimeDataFacts.model_validate(attributes)
    return TimeData(samples=np.asarray(arrays["samples"]), **dict(facts))


def transient_parts(transient: Transient) -> Contents:
    """Convert a sweep to its fundamentals over time."""
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


class _SweepFacts(BaseModel):
    """Attributes of a sweep."""

    channels: tuple[Channel, ...]
    window_periods: int


def transient_from(arrays: Mapping[str, Array], attributes: Mapping[str, object]) -> Transient:
    """Convert the output of `transient_parts` back; raise KeyError or ValueError for missing or unknown entries."""
    facts = _SweepFacts.model_validate(attributes)
    time_s, frequency_hz = (np.asarray(arrays[name], np.float64) for name in ("time_s", "frequency_hz"))
    fundamentals = np.asarray(arrays["fundamentals"], np.complex128)
    return Transient(facts.channels, time_s, frequency_hz, fundamentals, facts.window_periods)
