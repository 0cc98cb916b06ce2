"""Import recorded time data of a hammer test, and evaluate it, as `HammerTest`."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from identification.hammer.hammer_test import hammer_test
from identification.hammer.result import HammerTest
from identification.mapping.base import MeasurementMapping, NotNegative, Path, Positive, check_names, entries_at, in_si
from identification.mapping.sampling import SignalMapping, TimeUnit, one_rate_hz, stored_records


class HammerChannel(SignalMapping):
    """A channel and its samples."""

    full_scale: Positive | None = None
    """Value in ``unit`` from which the channel is overloaded; if left out, equal samples at the extreme show an overload."""
    scale: Positive = 1.0
    """Factor from stored numbers to ``unit``, such as the inverse of a sensitivity."""
    inverted: bool = False
    """Whether the sensor shows the opposite sign; a blow is a positive force."""


class HammerTestMapping(MeasurementMapping):
    """Where the samples of a hammer test are in the data, and how it is evaluated."""

    kind: Literal["hammer-test"]
    sample_rate_hz: Positive | None = None
    """Samples per second; if left out, taken from ``time`` or from the file."""
    time: Path | None = None
    """Path of the instants."""
    time_unit: TimeUnit = ""
    """Unit of the instants, such as ``ms``; if left out, the file's, or else seconds."""
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
        check_names(self.channels)
        return self


def map_hammer_test(data: Any, mapping: HammerTestMapping) -> HammerTest:
    """Return the hammer test in ``data``, evaluated in SI units.

    Raises `IdentificationError` if a path does not exist, lengths differ, sampling is uneven, values are NaN, or as
    `hammer_test`.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the channels lie, in which units, and how the test is evaluated.
    """
    channels, factors = in_si(mapping.channels)
    signs = np.array([-channel.scale if channel.inverted else channel.scale for channel in mapping.channels])
    entries = entries_at(data, mapping.records, "records")
    records = [
        record * (factors * signs)[:, None]
        for number, entry in enumerate(entries)
        for record in stored_records(entry, mapping.channels, f"records[{number}], " if mapping.records else "")
    ]
    rate = one_rate_hz(data, entries[0], mapping)
    return hammer_test(
        records,
        channels,
        rate,
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
