"""Import recorded time data of multisines as `PeriodicSpectra`."""

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, MappingTable, Path, as_levels, in_si, numbers, value_at
from identification.mapping.sampling import common_rate_hz, instants_at
from identification.multisine.design import MultisineDesign
from identification.multisine.spectra import PeriodicSpectra, periodic_spectra


class SignalMapping(ChannelMapping):
    """A channel and its samples."""

    value: Path
    """Path of the samples; columns of a matrix are realisations."""


class MultisineMapping(MappingTable):
    """Where the samples are in the data, and which multisine was played."""

    kind: Literal["multisine"]
    specimen: str = ""
    """Name of what was tested."""
    source: str = ""
    """Where the data comes from; for information only."""
    sample_rate_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None
    """Samples per second; if left out, taken from ``time`` or from the file."""
    time: Path | None = None
    """Path of the instants in seconds."""
    period_samples: Annotated[int, Field(ge=3)]
    """Number of samples in a period."""
    lowest_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    """Lowest frequency of the band."""
    highest_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
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
    """
    rate = _sample_rate(data, mapping)
    design = MultisineDesign(rate, mapping.period_samples, mapping.lowest_hz, mapping.highest_hz, mapping.grid)
    channels, factors = in_si(mapping.channels)
    records = []
    for number, entry in enumerate(_entries(data, mapping)):
        for record in _records(entry, mapping, f"realisation {number + 1}, " if mapping.realisations else ""):
            whole = record.shape[1] // design.period_samples * design.period_samples
            if not whole:
                raise IdentificationError(
                    f"have {record.shape[1]} samples",
                    field="channels",
                    allowed=f"one period, {design.period_samples} at least",
                )
            records.append(record[:, :whole] * factors[:, None])
    if mapping.records is not None:
        if unknown := [number for number in mapping.records if number > len(records)]:
            raise IdentificationError(f"{unknown[0]}, the data has 1 to {len(records)}", field="records")
        records = [records[number - 1] for number in mapping.records]
    return periodic_spectra(records, channels, design, transient_periods=mapping.transient_periods)


def _entries(data: Any, mapping: MultisineMapping) -> Any:
    if mapping.realisations is None:
        return [data]
    return as_levels(value_at(data, mapping.realisations, "realisations"), f"realisations '{mapping.realisations}'")


def _records(data: Any, mapping: MultisineMapping, where: str) -> list[NDArray[np.float64]]:
    """Return one array float[n_channels, n] per column of the stored signals."""
    signals = [
        numbers(value_at(data, c.value, f"{where}channels.{c.name}"), 2, f"{where}channels.{c.name}")
        for c in mapping.channels
    ]
    if len({signal.shape for signal in signals}) > 1:
        shapes = ", ".join(f"{c.name} {signal.shape}" for c, signal in zip(mapping.channels, signals, strict=True))
        raise IdentificationError(f"unequal lengths ({shapes})", where=where, field="channels")
    return [np.array([s[:, column] for s in signals], dtype=np.float64) for column in range(signals[0].shape[1])]


def _sample_rate(data: Any, mapping: MultisineMapping) -> float:
    """Return the sample rate; the rates from the mapping, the instants and the file must agree."""
    told = {"sample_rate_hz": mapping.sample_rate_hz}
    if mapping.time is not None:
        told["time"] = instants_at(_entries(data, mapping)[0], mapping.time)[0]
    if isinstance(data, dict) and isinstance(data.get("sample_rate_hz"), float):
        told["file"] = data["sample_rate_hz"]
    return common_rate_hz(told)
