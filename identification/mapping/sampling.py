"""Sample rate of data that a mapping describes."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Protocol

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
WHOLE = 0.05
"""Largest part of a sample by which the beginnings of two channels may miss the common grid."""
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


class SampledMapping(Protocol):
    """A mapping of channels that were sampled together."""

    @property
    def sample_rate_hz(self) -> float | None:
        """Samples per second that it says."""

    @property
    def time(self) -> str | None:
        """Path of the instants."""

    @property
    def time_unit(self) -> str:
        """Unit of the instants."""

    @property
    def channels(self) -> Sequence[SignalMapping]:
        """The channels."""


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


def rates_of_file(data: Any, paths: Sequence[str], of: str = "file") -> dict[str, float | None]:
    """Return the sample rates that a file tells of all channels and of those at the paths, by where they are from."""
    told: dict[str, float | None] = {of: rate_of_file_hz(data)}
    rates = data.get("__rates_hz__") if isinstance(data, Mapping) else None
    if isinstance(rates, Mapping):
        told |= {f"{of} ({path})": rates[path] for path in paths if isinstance(rates.get(path), float)}
    return told


def start_of_file_s(data: Any, path: str) -> float:
    """Return the instant at which the channel at a path begins by the file, s; 0 if it tells none."""
    starts = data.get("__starts_s__") if isinstance(data, Mapping) else None
    start = starts.get(path) if isinstance(starts, Mapping) else None
    return start if isinstance(start, float) else 0.0


def _check_starts(data: Any, channels: Sequence[SignalMapping], rate_hz: float) -> None:
    """Raise `IdentificationError` if channels begin at different instants by the file, for mappings that line up none."""
    starts = [start_of_file_s(data, channel.value) for channel in channels]
    late = (np.array(starts) - min(starts)) * rate_hz
    if late.max() > WHOLE:
        at = int(np.argmax(late))
        reason = f"begins {late[at]:.2f} samples after another"
        hint = '`kind = "time-data"` lines channels up; or say `against_file = true` if the start times are wrong'
        raise IdentificationError(reason, field=f"channels.{channels[at].name}", hint=hint)


def one_rate_hz(data: Any, entry: Any, mapping: SampledMapping) -> float:
    """Return the sample rate of all channels, on which file and mapping agree; ``entry`` is the structure with the instants.

    Raises `IdentificationError` if they disagree, say none, or begin channels at different instants.
    """
    time, wanted = mapping.time, mapping.sample_rate_hz
    seconds = seconds_of_time(data, mapping.time_unit)
    told = {
        "sample_rate_hz": wanted,
        "time": None if time is None else instants_at(entry, time, seconds, wanted).rate_hz,
        **rates_of_file(data, [channel.value for channel in mapping.channels]),
    }
    rate = common_rate_hz(told)
    check_rates_beside(data, rate)
    _check_starts(data, mapping.channels, rate)
    return rate


def check_rates_beside(data: Any, rate_hz: float) -> None:
    """Raise `IdentificationError` if numbers beside the signals, named as sample rates, say another rate (Hz, or kHz)."""
    beside = data.get("__rates_beside_hz__") if isinstance(data, Mapping) else None
    for path, (told, rounding) in (beside or {}).items():
        if all(abs(told * factor / rate_hz - 1.0) > rounding + _SAME for factor in (1.0, 1e3)):
            raise IdentificationError(
                f"'{path}' in the file says {told:g} Hz",
                field="sample_rate_hz",
                value=rate_hz,
                hint="correct the mapping, or say `against_file = true` at the top if that number is another",
            )


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
