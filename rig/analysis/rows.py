"""Points of periodic responses taken out, turned round and put together."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from simulators.analysis import PeriodicResponses

__all__ = ["joined", "part", "turned"]


def turned(way: PeriodicResponses) -> PeriodicResponses:
    """The same points in the opposite order."""
    return part(way, slice(None, None, -1))


def part(way: PeriodicResponses, rows: slice) -> PeriodicResponses:
    """Some of the points."""
    return _of_columns(lambda column: column[rows], way)


def joined(first: PeriodicResponses, then: PeriodicResponses) -> PeriodicResponses:
    """The points of one after those of another."""
    return _of_columns(lambda one, other: np.concatenate([one, other]), first, then)


def _of_columns(make: Callable[..., Any], *ways: PeriodicResponses) -> PeriodicResponses:
    """Responses whose every column is made of the columns of others."""
    columns: dict[str, Any] = {}
    for field in fields(PeriodicResponses):
        those = [getattr(way, field.name) for way in ways]
        if isinstance(those[0], dict):
            columns[field.name] = {name: make(*(column[name] for column in those)) for name in those[0]}
        elif those[0] is not None:
            columns[field.name] = make(*those)
    return PeriodicResponses(**columns)
