"""Sample rate of data that a mapping describes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, Path, numbers, value_at

_SAME = 1e-6
"""Largest relative difference of sample rates that count as one."""
_UNEVEN = 1e-3
"""Largest difference of a step from the mean step."""


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


def instants_at(data: Any, path: str) -> tuple[float, float]:
    """Return the sample rate (Hz) and the first of the instants (s) at a path; raise `IdentificationError` for uneven ones."""
    instants: NDArray[np.float64] = np.asarray(numbers(value_at(data, path, "time"), 1, "time"), dtype=np.float64)
    steps = np.diff(instants)
    step = (instants[-1] - instants[0]) / max(steps.size, 1) if instants.size else 0.0
    if not steps.size or not step > 0.0 or np.any(np.abs(steps - step) > _UNEVEN * step):
        raise IdentificationError(f"time '{path}': is not evenly spaced; resample the signals")
    return float(1.0 / step), float(instants[0])


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
