"""Import recorded time data of a hammer test, and evaluate it, as `HammerTest`."""

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from identification.errors import IdentificationError
from identification.hammer.hammer_test import hammer_test
from identification.hammer.result import HammerTest
from identification.mapping.base import ChannelMapping, MappingTable, Path, as_levels, in_si, numbers, value_at
from vibrolock.errors import InputError

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]

_EVEN = 1e-3
"""Relative difference of steps of time up to which they count as even. Chosen: times are often rounded."""


class HammerChannel(ChannelMapping):
    """A channel and its samples."""

    value: Path
    """Path of the samples; columns of a matrix are records."""
    full_scale: Positive | None = None
    """Value in ``unit`` from which the channel is overloaded; if left out, equal samples at the extreme show an overload."""
    inverted: bool = False
    """Whether the sensor shows the opposite sign; a blow is a positive force."""


class HammerTestMapping(MappingTable):
    """Where the samples of a hammer test are in the data, and how it is evaluated."""

    kind: Literal["hammer-test"]
    specimen: str = ""
    """Name of what was tested."""
    source: str = ""
    """Where the data comes from; for information only."""
    sample_rate_hz: Positive | None = None
    """Samples per second; if left out, taken from ``time`` or from the file."""
    time: Path | None = None
    """Path of the instants in seconds."""
    records: Path | None = None
    """Path of a list with one structure per record; the other paths are relative to these structures."""
    record_s: Positive | None = None
    """Length of the record of one hit, with the time before it; if left out, as long as the hits allow."""
    pretrigger_s: NotNegative | None = None
    """Time before a hit; if left out, a twentieth of the record."""
    trigger_n: Positive | None = None
    """Force that makes a hit, N; if left out, a tenth of the largest force."""
    force_window_s: Positive | None = None
    """Length of the force window from the beginning of the pulse; if left out, five times the pulse."""
    decay_rate_1_s: NotNegative | None = None
    """Rate a of the exponential window exp(-a t), 1/s; 0 for none; if left out, as high as the motions need to end in time."""
    estimator: Literal["H1", "H2", "Hv"] = "H1"
    """Estimator of the frequency responses."""
    lowest_hz: Positive | None = None
    """Lowest line; if left out, the second."""
    highest_hz: Positive | None = None
    """Highest line; if left out, where the spectrum of the force has fallen by 20 dB."""
    channels: Annotated[tuple[HammerChannel, ...], Field(min_length=2)]
    """The channels, one of role ``force`` and one of role ``drive``, the motion where the hammer hits."""

    @model_validator(mode="after")
    def _different(self) -> "HammerTestMapping":
        names = [channel.name for channel in self.channels]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise InputError(f"'{twice}' is the name of two", field="channels", hint="names must differ")
        return self


def map_hammer_test(data: Any, mapping: HammerTestMapping) -> HammerTest:
    """Return the hammer test in ``data``, evaluated in SI units.

    Raises `IdentificationError` if a path does not exist, lengths differ, sampling is uneven, values are NaN, or as
    `hammer_test`.
    """
    channels, factors = in_si(mapping.channels)
    signs = np.array([-1.0 if channel.inverted else 1.0 for channel in mapping.channels])
    entries = [data] if mapping.records is None else as_levels(value_at(data, mapping.records, "records"), "records")
    records = [
        record * (factors * signs)[:, None]
        for number, entry in enumerate(entries)
        for record in _records(entry, mapping, number)
    ]
    return hammer_test(
        records,
        channels,
        _sample_rate(data, entries[0], mapping),
        record_s=mapping.record_s,
        pretrigger_s=mapping.pretrigger_s,
        trigger_n=mapping.trigger_n,
        force_window_s=mapping.force_window_s,
        decay_rate_1_s=mapping.decay_rate_1_s,
        full_scale={
            channel.name: channel.full_scale * factor
            for channel, factor in zip(mapping.channels, factors, strict=True)
            if channel.full_scale is not None
        },
        estimator=mapping.estimator,
        lowest_hz=mapping.lowest_hz,
        highest_hz=mapping.highest_hz,
        specimen=mapping.specimen,
    )


def _records(entry: Any, mapping: HammerTestMapping, number: int) -> list[NDArray[np.float64]]:
    """Return one array float[n_channels, n] per column of the stored signals."""
    where = f"records[{number}], " if mapping.records else ""
    signals = [
        numbers(value_at(entry, c.value, f"{where}channels.{c.name}"), 2, f"{where}channels.{c.name}")
        for c in mapping.channels
    ]
    if len({signal.shape for signal in signals}) > 1:
        shapes = ", ".join(f"{c.name} {signal.shape}" for c, signal in zip(mapping.channels, signals, strict=True))
        raise IdentificationError(f"unequal lengths ({shapes})", where=where, field="channels")
    return [np.array([s[:, column] for s in signals], dtype=np.float64) for column in range(signals[0].shape[1])]


def _sample_rate(data: Any, entry: Any, mapping: HammerTestMapping) -> float:
    """Return the sample rate of the mapping, of the instants or of the file, in this order."""
    if mapping.sample_rate_hz is not None:
        return mapping.sample_rate_hz
    if mapping.time is not None:
        instants = np.asarray(numbers(value_at(entry, mapping.time, "time"), 1, "time"), dtype=np.float64)
        steps = np.diff(instants)
        step = (instants[-1] - instants[0]) / max(steps.size, 1)
        if not steps.size or not step > 0.0 or np.any(np.abs(steps - step) > _EVEN * step):
            raise IdentificationError(f"time '{mapping.time}': is not evenly spaced; resample the signals")
        return float(1.0 / step)
    if isinstance(data, dict) and isinstance(data.get("sample_rate_hz"), float):
        return float(data["sample_rate_hz"])
    raise IdentificationError("is missing", field="sample_rate_hz", hint="give it, or time")
