"""Records over time that somebody else has measured: channels, samples, periods, levels."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.storage import stored
from identification.validation import convert_fields, finite_array, positive
from vibrolock.arrays import Float
from vibrolock.results import Result


@dataclass(frozen=True, eq=False, kw_only=True)
class TimeRecord:
    """One record of all channels.

    Parameters
    ----------
    samples
        float[n_channels, n], in the units of the channels.
    name
        Name for tables and messages.
    level
        Level by which records are grouped; NaN if there is none.
    """

    samples: Float
    name: str = ""
    level: float = float("nan")

    def __post_init__(self) -> None:
        where = f"record '{self.name}', samples" if self.name else "samples"
        object.__setattr__(self, "samples", finite_array(where, self.samples, np.float64, 2))


def _upgrade(arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Split the samples of earlier files, which hold all records side by side."""
    if "lengths" not in arrays:
        return
    samples, lengths, levels = (arrays.pop(name, np.zeros(0)) for name in ("samples", "lengths", "levels"))
    if samples.ndim != 2 or np.any(lengths < 0) or lengths.sum() != samples.shape[1]:
        raise IdentificationError(f"do not add up to the samples, which have shape {samples.shape}", field="lengths")
    parts = np.split(samples, np.cumsum(lengths)[:-1], axis=1)
    arrays.update({f"records_{number}/samples": part for number, part in enumerate(parts)})
    named = zip(attributes.pop("names", ()), levels.tolist(), strict=True)
    attributes["records"] = [{"name": name, "level": level} for name, level in named]


@stored(upgrade=_upgrade)
@dataclass(frozen=True, eq=False, kw_only=True)
class TimeRecords(Result):
    """Evenly sampled records of the same channels at one sample rate.

    Raises `IdentificationError` if shapes do not agree, a record is not a whole number of periods, names are used twice
    or an instrument does not exist.

    Parameters
    ----------
    channels
        One per row of the samples.
    sample_rate_hz
        Samples per second.
    records
        The records, one or more.
    period_samples
        Number of samples in a period: every record is a whole number of settled periods. 0 for records that are not periodic.
    ahead_periods
        Periods that are put ahead of a periodic record when a model is simulated from rest, so that its transient decays.
    at_rest
        Whether a record that is not periodic begins at rest. Otherwise the state at its beginning is estimated.
    excited_hz
        Lowest and highest excited frequency; None if unknown.
    instrument
        Name of a noise-free channel, such as the voltage of a generator; empty if there is none.
    specimen
        Name of what was tested.
    source
        Where the data comes from.
    notes
        Remarks for the user, one line each.
    """

    channels: tuple[Channel, ...]
    sample_rate_hz: float
    records: tuple[TimeRecord, ...]
    period_samples: int = 0
    ahead_periods: float = 1.0
    at_rest: bool = False
    excited_hz: tuple[float, float] | None = None
    instrument: str = ""
    specimen: str = ""
    source: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "channels", "records", "notes")
        positive("sample_rate_hz", self.sample_rate_hz, "Hz")
        names = [channel.name for channel in self.channels]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise IdentificationError(f"'{twice}' is the name of two", field="channels", hint="names must differ")
        IdentificationError.raise_if(not self.records, "there is none", field="records", allowed="one at least")
        if self.instrument and self.instrument not in names:
            raise IdentificationError(f"channels are {', '.join(names)}", field="instrument", value=self.instrument)
        if not 0.0 <= self.ahead_periods < np.inf:
            raise IdentificationError(field="ahead_periods", value=self.ahead_periods, allowed="zero or more")
        for number, record in enumerate(self.records, 1):
            rows, count = record.samples.shape
            if rows != len(names) or not count:
                raise IdentificationError(f"record {number}: shape {(rows, count)}, needs {len(names)} rows of samples")
            if self.period_samples < 0 or (self.period_samples and count % self.period_samples):
                reason = f"record {number}: has {count} samples, not a whole number of periods of {self.period_samples}"
                raise IdentificationError(reason)

    @property
    def level_unit(self) -> str:
        """Unit of the levels: that of the first channel of role ``force``; empty if there is none."""
        return next((channel.unit for channel in self.channels if channel.role == "force"), "")

    def levels(self) -> "dict[float, TimeRecords]":
        """Return the records of each level, in rising order; records without a level are one level, NaN."""
        found: dict[float, list[TimeRecord]] = {}
        for record in sorted(self.records, key=lambda one: one.level):
            key = next(
                (level for level in found if level == record.level or np.isnan([level, record.level]).all()), None
            )
            found.setdefault(record.level if key is None else key, []).append(record)
        return {level: replace(self, records=tuple(some)) for level, some in found.items()}
