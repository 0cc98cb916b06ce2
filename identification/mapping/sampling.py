"""Sample rate of data that a mapping describes."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, Path, numbers, value_at
from identification.mapping.instants import EvenSampling, even_sampling, uneven_remark
from vibrolock.errors import InputError
from vibrolock.quantities import seconds_in

_SAME = 1e-6
"""Largest relative difference of sample rates that count as one."""
TIME_UNITS = ("s", "ms", "us", "ns", "min", "h")
"""Usual units of instants; other spellings are understood as well."""


def checked_time_unit(unit: str) -> str:
    """Return a unit of time; raise `InputError` for any other."""
    if unit and seconds_in(unit) is None:
        raise InputError(field="time_unit", value=unit, allowed=TIME_UNITS)
    return unit


TimeUnit = Annotated[str, AfterValidator(checked_time_unit)]
"""Unit of instants; empty for that of the file, or else seconds."""


class SignalMapping(ChannelMapping):
    """A channel and its samples."""

    value: Path
    """Path of the samples; columns of a matrix are records."""


def stored_records(entry: Any, channels: Sequence[SignalMapping], where: str) -> list[NDArray[np.float64]]:
    """Return one array float[n_channels, n] per column of the stored signals."""
    signals = [
        numbers(value_at(entry, c.value, f"{where}channels.{c.name}"), 2, f"{where}channels.{c.name}") for c in channels
    ]
    if len({signal.shape for signal in signals}) > 1:
        shapes = ", ".join(f"{c.name} {signal.shape}" for c, signal in zip(channels, signals, strict=True))
        raise IdentificationError(f"unequal lengths ({shapes})", where=where, field="channels")
    return [np.array([s[:, column] for s in signals], dtype=np.float64) for column in range(signals[0].shape[1])]


def rate_of_file_hz(data: Any) -> float | None:
    """Return the sample rate that the file itself states; None if it does not."""
    rate = data.get("sample_rate_hz") if isinstance(data, Mapping) else None
    return rate if isinstance(rate, float) else None


def instants_at(data: Any, path: str, seconds: float = 1.0, wanted_hz: float | None = None) -> EvenSampling:
    """Return the sampling of the instants at a path, in units of ``seconds``; raise `IdentificationError` for uneven ones."""
    instants = numbers(value_at(data, path, "time"), 1, "time")
    found = even_sampling(instants, seconds, wanted_hz)
    if found is None:
        raise IdentificationError(f"time '{path}': {uneven_remark(instants)}")
    return found


def seconds_of_time(data: Any, time_unit: str) -> float:
    """Return the seconds in the unit of the instants: that of a mapping, or else that of the file, or else seconds."""
    told = data.get("__time_unit__") if isinstance(data, Mapping) else None
    unit = time_unit or (told if isinstance(told, str) else "") or "s"
    found = seconds_in(unit)
    if found is None:
        raise IdentificationError(field="time_unit", value=unit, allowed=TIME_UNITS)
    return found


def common_rate_hz(told: Mapping[str, float | None]) -> float:
    """Return the sample rate on which all that name one agree, by where it is from; raise `IdentificationError` otherwise."""
    rates = {name: rate for name, rate in told.items() if rate is not None}
    IdentificationError.raise_if(not rates, "is missing", field="sample_rate_hz", hint="give it, or time")
    lowest, highest = min(rates.values()), max(rates.values())
    if not lowest > 0.0 or not highest < np.inf or highest / lowest - 1.0 > _SAME:
        text = ", ".join(f"{name} {rate:g} Hz" for name, rate in rates.items())
        reason = f"disagrees ({text})"
        raise IdentificationError(reason, field="sample_rate_hz", hint="correct or leave out the wrong one")
    return next(iter(rates.values()))
