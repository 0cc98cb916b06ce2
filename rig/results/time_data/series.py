"""Samples over time of one recorded point, and their exchange."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification import Channel, IdentificationError, TimeRecord, TimeRecords
from identification.common import decode, encode
from rig.campaigns.evaluation.point import point_name
from rig.results.kind import Exchange
from rig.text.contents import Array, Contents


@dataclass(frozen=True, eq=False)
class TimeData:
    """Evenly sampled signals.

    Raises
    ------
    IdentificationError
        If shapes do not agree, for inf, or for a rate that is not above zero.
    """

    channels: tuple[Channel, ...]
    """One per row of ``samples``."""
    samples: NDArray[np.floating]
    """float[n_channels, n], in the SI unit of each channel; NaN where samples were lost in transfer."""
    sample_rate_hz: float
    """Samples per second."""
    start_s: float = 0.0
    """Time of the first sample."""
    point: int = 0
    """Stored number of the point, from 0."""
    specimen: str = ""
    """Name of the specimen."""

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


def units_and_labels(channels: Sequence[Channel]) -> tuple[Array, tuple[tuple[str, ...]]]:
    """Return units and names of channels as `Contents` has them."""
    return np.array([channel.unit for channel in channels]), (tuple(channel.name for channel in channels),)


def _contents(data: TimeData) -> Contents:
    arrays, attributes = encode(data)
    arrays["time_s"] = data.start_s + np.arange(data.samples.shape[1]) / data.sample_rate_hz
    units, labels = units_and_labels(data.channels)
    title = f"{data.specimen}, {point_name(data.point)}"
    rows = {"time_s": 0, "samples": 1}
    return Contents("time-data", title, arrays, attributes, rows, {"samples": units}, {"samples": labels})


EXCHANGE = Exchange("time-data", TimeData, _contents, partial(decode, TimeData))
