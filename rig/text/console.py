"""Tables and JSON documents on standard output."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from rig.text.printable import printable

__all__ = ["number", "print_json", "print_table"]


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON document on standard output; numbers that are not finite become null."""
    print(json.dumps(_finite(value), indent=2))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def number(value: float | None, pattern: str, scale: float = 1.0) -> str:
    """Return a number in a format, or a dash for None or NaN."""
    return "-" if value is None or value != value else format(scale * value, pattern)


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of right-aligned columns."""
    lines = [[printable(cell) for cell in row] for row in [headings, *rows]]
    widths = [max(len(row[column]) for row in lines) for column in range(len(headings))]
    for row in lines:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
