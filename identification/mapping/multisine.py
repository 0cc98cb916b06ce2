"""Import recorded time data of multisines as `PeriodicSpectra`."""

from typing import Annotated, Any, Literal

from pydantic import Field

from identification.errors import IdentificationError
from identification.mapping.base import MeasurementMapping, Path, Positive, entries_at, in_si
from identification.mapping.sampling import SignalMapping, TimeUnit, one_rate_hz, stored_records
from identification.multisine.design import MultisineDesign
from identification.multisine.spectra import PeriodicSpectra, periodic_spectra


class MultisineMapping(MeasurementMapping):
    """Where the samples are in the data, and which multisine was played."""

    kind: Literal["multisine"]
    sample_rate_hz: Positive | None = None
    """Samples per second; if left out, taken from ``time`` or from the file."""
    time: Path | None = None
    """Path of the instants."""
    time_unit: TimeUnit = ""
    """Unit of the instants, such as ``ms``; if left out, the file's, or else seconds."""
    period_samples: Annotated[int, Field(ge=3)]
    """Number of samples in a period."""
    lowest_hz: Positive
    """Lowest frequency of the band."""
    highest_hz: Positive
    """Highest frequency of the band."""
    grid: Literal["full", "odd"] = "full"
    """Whether every line of the band is excited or only odd multiples of the resolution."""
    transient_periods: Annotated[int, Field(ge=0)] = 0
    """Number of periods to discard at the beginning."""
    instrument: str = ""
    """Name of the noise-free channel, the voltage; if left out, the force is used, which gives the H1 estimate."""
    realisations: Path | None = None
    """Path of a list with one structure per realisation; the other paths are relative to these structures."""
    records: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)] | None = None
    """Numbers of the records (columns, or structures) that are read, from 1: those of one level; by default all."""
    channels: Annotated[tuple[SignalMapping, ...], Field(min_length=2)]
    """The channels, one of role ``force``."""


def map_multisine(data: Any, mapping: MultisineMapping) -> PeriodicSpectra:
    """Return the spectra of all realisations, in SI units.

    Samples beyond the last whole period are discarded. Raises `IdentificationError` if a path does not exist, sample rates
    disagree, sampling is uneven, lengths differ, values are NaN, or there is less than one whole period.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the quantities lie, in which units.
    """
    entries = entries_at(data, mapping.realisations, "realisations")
    rate = one_rate_hz(data, entries[0], mapping)
    design = MultisineDesign(rate, mapping.period_samples, mapping.lowest_hz, mapping.highest_hz, mapping.grid)
    channels, factors = in_si(mapping.channels)
    records = []
    for number, entry in enumerate(entries, 1):
        for record in stored_records(
            entry, mapping.channels, f"realisation {number}, " if mapping.realisations else ""
        ):
            whole = record.shape[1] // design.period_samples * design.period_samples
            if not whole:
                allowed = f"one period, {design.period_samples} at least"
                raise IdentificationError(f"have {record.shape[1]} samples", field="channels", allowed=allowed)
            records.append(record[:, :whole] * factors[:, None])
    if mapping.records is not None:
        if unknown := [number for number in mapping.records if number > len(records)]:
            raise IdentificationError(f"{unknown[0]}, the data has 1 to {len(records)}", field="records")
        records = [records[number - 1] for number in mapping.records]
    return periodic_spectra(records, channels, design, transient_periods=mapping.transient_periods)
