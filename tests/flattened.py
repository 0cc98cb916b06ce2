"""Results as numbers and texts by path, to compare them field by field."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np


def flattened(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield path and value of everything in a dataclass; arrays as nested lists, complex ones as [real, imaginary]."""
    if is_dataclass(value):
        for one in fields(value):
            yield from flattened(getattr(value, one.name), f"{path}.{one.name}")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from flattened(item, f"{path}[{key}]")
    elif isinstance(value, (tuple, list)):
        yield f"{path}#", len(value)
        for number, item in enumerate(value):
            yield from flattened(item, f"{path}[{number}]")
    elif isinstance(value, np.ndarray):
        parts = [value.real, value.imag] if np.iscomplexobj(value) else [value]
        yield path, [value.dtype.kind, *(part.tolist() for part in parts)]
    else:
        yield path, value.value if isinstance(value, Enum) else value
