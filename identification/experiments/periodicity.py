"""Whether records that are said to be periodic are: by how much the periods of what drives them differ.

The measure is the RMS of the differences of successive periods over that of two unrelated signals of the same size, which is
``sqrt(2)`` times the RMS of the channel. Noise of a share n of the RMS gives n, a wrong length of the period about 1.
"""

from collections.abc import Iterator

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.time_records import TimeRecords

_REFUSED = 0.5
"""Difference of the periods from which a record is not periodic."""
_REMARKED = 0.05
"""Difference of the periods from which they are remarked on."""


def check_periods(records: TimeRecords) -> None:
    """Raise `IdentificationError` if the input of a record has no periods of the length that is said of it."""
    for record, channel, difference in _differences(records):
        if difference > _REFUSED:
            raise IdentificationError(
                f"in record '{record}' such periods of channel '{channel}' differ by {100.0 * difference:.0f} %",
                field="period_samples",
                value=records.period_samples,
                allowed=f"up to {100.0 * _REFUSED:.0f} %",
                hint="give the right length, or leave it out for data that are not periodic",
            )


def period_remark(records: TimeRecords) -> str:
    """Return a remark on periods of the input that differ; empty if there is no need."""
    found = max(_differences(records), key=lambda one: one[2], default=("", "", 0.0))
    record, channel, difference = found
    if difference <= _REMARKED:
        return ""
    return (
        f"periods of channel '{channel}' differ by up to {100.0 * difference:.2g} % (record '{record}'): noise, a transient "
        "(key `transient_periods`), or a period of another length"
    )


def _differences(records: TimeRecords) -> Iterator[tuple[str, str, float]]:
    """Yield record, channel and difference of the periods for every input of every record: the instrument, or the forces."""
    size = records.period_samples
    names = {records.instrument} - {""} or {channel.name for channel in records.channels if channel.role == "force"}
    for record in records.records if size else ():
        for channel, samples in zip(records.channels, record.samples, strict=True):
            periods = samples.reshape(-1, size)
            spread = float(np.std(samples))
            if channel.name in names and len(periods) > 1 and spread > 0.0:
                yield record.name, channel.name, float(np.sqrt(0.5 * np.mean(np.diff(periods, axis=0) ** 2))) / spread
