"""Numbers of an analysis as plain lists and dictionaries, for JSON."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from simulators.analysis import PeriodicResponses
from simulators.layout import Flag

__all__ = ["plain", "points_of"]


def plain(value: Any) -> Any:
    """``value`` with arrays as lists, dataclasses as dictionaries, and a complex number as ``[re, im]``."""
    if isinstance(value, PeriodicResponses):
        return points_of(value)
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        parts = np.stack([value.real, value.imag], axis=-1) if np.iscomplexobj(value) else value
        return parts.tolist()
    return value.item() if isinstance(value, np.generic) else value


def points_of(responses: PeriodicResponses) -> list[dict[str, Any]]:
    """One dictionary per point with everything that is known of it; flags by their names."""
    columns: dict[str, Any] = {
        field.name: getattr(responses, field.name)
        for field in fields(responses)
        if field.name != "flags" and getattr(responses, field.name) is not None
    }
    return [
        {
            **{
                name: plain({key: item[k] for key, item in column.items()} if isinstance(column, dict) else column[k])
                for name, column in columns.items()
            },
            "flags": [str(flag.name).lower() for flag in Flag if responses.flags[k] & int(flag)],
        }
        for k in range(responses.frequency_hz.size)
    ]
