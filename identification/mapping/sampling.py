"""Sample rate of data that a mapping describes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.mapping.base import numbers, value_at

_SAME = 1e-6
"""Largest relative difference of sample rates that count as one."""
_UNEVEN = 1e-3
"""Largest difference of a step from the mean step."""


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
        raise IdentificationError(
            f"disagrees ({text})", field="sample_rate_hz", hint="correct or leave out the wrong one"
        )
    return next(iter(rates.values()))
