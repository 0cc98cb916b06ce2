"""Time data of multisines that others recorded, as `PeriodicSpectra`."""

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, MappingTable, Path, as_levels, in_si, numbers, value_at
from identification.multisine.design import MultisineDesign
from identification.multisine.spectra import PeriodicSpectra, periodic_spectra

__all__ = ["MultisineMapping", "map_multisine"]

_RATE = 1e-6  # relative


class SignalMapping(ChannelMapping):
    """A channel and its samples."""

    value: Path
    """Path of the samples; columns of a matrix are realisations."""


class MultisineMapping(MappingTable):
    """Where the samples are, and what was played."""

    kind: Literal["multisine"]
    specimen: str = ""
    """Name of what was tested."""
    source: str = ""
    """Where the data comes from; for the reader."""
    sample_rate_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None
    """Samples per second; left out: from ``time``, or what the file says."""
    time: Path | None = None
    """Path of the instants in seconds."""
    period_samples: Annotated[int, Field(ge=3)]
    """Samples of a period."""
    lowest_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    """Lowest frequency of the band."""
    highest_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    """Highest frequency of the band."""
    grid: Literal["full", "odd"] = "full"
    """Whether every line of the band is excited or only odd multiples of the resolution."""
    transient_periods: Annotated[int, Field(ge=0)] = 0
    """Periods at the beginning that are left out."""
    instrument: str = ""
    """Name of the channel that is known without noise, the voltage; left out: the force, which gives H1."""
    realisations: Path | None = None
    """Path of a list with one structure for each realisation, in which the other paths start."""
    channels: Annotated[tuple[SignalMapping, ...], Field(min_length=2)]
    """The channels, one of role ``force``."""


def map_multisine(data: Any, mapping: MultisineMapping) -> PeriodicSpectra:
    """Spectra of all realisations, in SI.

    Samples beyond whole periods are left out at the end. Raises `IdentificationError` on a path that is not there, rates
    that disagree, uneven sampling, unequal lengths, NaN, or fewer than one whole period.
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
                    f"channels: have {record.shape[1]} samples, needs one period, {design.period_samples} at least"
                )
            records.append(record[:, :whole] * factors[:, None])
    return periodic_spectra(records, channels, design, transient_periods=mapping.transient_periods)


def _entries(data: Any, mapping: MultisineMapping) -> Any:
    if mapping.realisations is None:
        return [data]
    return as_levels(value_at(data, mapping.realisations, "realisations"), f"realisations '{mapping.realisations}'")


def _records(data: Any, mapping: MultisineMapping, where: str) -> list[NDArray[np.float64]]:
    """One array float[n_channels, n] per column of the stored signals."""
    signals = [
        numbers(value_at(data, c.value, f"{where}channels.{c.name}"), 2, f"{where}channels.{c.name}")
        for c in mapping.channels
    ]
    if len({signal.shape for signal in signals}) > 1:
        shapes = ", ".join(f"{c.name} {signal.shape}" for c, signal in zip(mapping.channels, signals, strict=True))
        raise IdentificationError(f"{where}channels: unequal lengths ({shapes})")
    return [np.array([s[:, column] for s in signals], dtype=np.float64) for column in range(signals[0].shape[1])]


def _sample_rate(data: Any, mapping: MultisineMapping) -> float:
    """The sample rate; what mapping, instants and file say must agree."""
    told = {"sample_rate_hz": mapping.sample_rate_hz}
    if mapping.time is not None:
        entry = _entries(data, mapping)[0]
        instants = np.asarray(numbers(value_at(entry, mapping.time, "time"), 1, "time"), dtype=np.float64)
        steps = np.diff(instants)
        step = (instants[-1] - instants[0]) / max(steps.size, 1)
        if not steps.size or not step > 0.0 or np.any(np.abs(steps - step) > 1e-3 * step):
            raise IdentificationError(f"time '{mapping.time}': is not evenly spaced; resample the signals")
        told["time"] = 1.0 / step
    if isinstance(data, dict) and isinstance(data.get("sample_rate_hz"), float):
        told["file"] = data["sample_rate_hz"]
    rates = {name: rate for name, rate in told.items() if rate is not None}
    if not rates:
        raise IdentificationError("sample_rate_hz: is missing; give it, or time")
    lowest, highest = min(rates.values()), max(rates.values())
    if highest / lowest - 1.0 > _RATE:
        text = ", ".join(f"{name} {rate:g} Hz" for name, rate in rates.items())
        raise IdentificationError(f"sample_rate_hz: disagrees ({text}); correct or leave out the wrong one")
    return next(iter(rates.values()))
