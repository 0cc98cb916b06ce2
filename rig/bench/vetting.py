"""Checks of a user's table, independent of its meaning, before a model reads it.

Models can then rely on numbers whose squares do not overflow, on texts without control characters and on limited nesting.
"""

from collections.abc import Iterator
from math import isfinite
from unicodedata import category

from rig.errors import ConfigurationError
from vibrolock.printable import shown

DEEPEST = 16
"""Largest number of nested tables and lists."""
SMALLEST, LARGEST = 1e-30, 1e30
"""Allowed magnitudes of a number other than 0, in any SI unit: every quantity of a vibration test lies inside."""
LARGEST_INTEGER = 2**63 - 1
"""Largest magnitude of a whole number: that of TOML and HDF5, 64 bits."""
LONGEST_KEY = 200
"""Longest key, characters; chosen: no name of ours is a quarter as long."""
LONGEST_TEXT = 10_000
"""Longest text, characters; chosen: some pages of remarks."""


def refuse_absurd(table: object, source: str) -> None:
    """Raise `ConfigurationError` for the first value that is not allowed in any table."""
    for path, depth, value in _values(table):
        ConfigurationError.raise_if(
            depth > DEEPEST, "is nested too deeply", where=source, field=path, allowed=f"up to {DEEPEST} levels"
        )
        for key in value if isinstance(value, dict) else ():
            if not isinstance(key, str) or len(key) > LONGEST_KEY or _moves_the_cursor(key):
                what = f"printable names of up to {LONGEST_KEY} characters"
                raise ConfigurationError(f"holds the key {shown(key)}", where=source, field=path, allowed=what)
        if (allowed := _violated(value)) is not None:
            # A number of many bits has more digits than Python prints.
            at_fault = f"{value.bit_length()} bits" if isinstance(value, int) else value
            raise ConfigurationError(where=source, field=path, value=at_fault, allowed=allowed)


def _values(table: object) -> Iterator[tuple[str, int, object]]:
    """Yield path, depth and value of all entries of a table, without recursion; do not descend below `DEEPEST` levels."""
    left: list[tuple[str, int, object]] = [("", 0, table)]
    while left:
        path, depth, value = left.pop()
        yield path, depth, value
        if depth > DEEPEST:
            continue
        if isinstance(value, dict):
            items = [(f"{path}.{key}" if path else str(key), depth + 1, item) for key, item in value.items()]
        elif isinstance(value, list | tuple):
            items = [(f"{path}[{index}]", depth + 1, item) for index, item in enumerate(value)]
        else:
            continue
        left += reversed(items)


def _violated(value: object) -> str | None:
    """Return what is allowed in place of a value, or None if the value is allowed."""
    if isinstance(value, int):
        return f"up to {LARGEST_INTEGER}" if abs(value) > LARGEST_INTEGER else None
    if isinstance(value, float) and not (value == 0.0 or SMALLEST <= abs(value) <= LARGEST):
        return f"0, or a size from {SMALLEST:g} to {LARGEST:g}" if isfinite(value) else "a finite number"
    if isinstance(value, str) and len(value) > LONGEST_TEXT:
        return f"up to {LONGEST_TEXT} characters"
    if isinstance(value, str) and not value.isprintable() and _moves_the_cursor("".join(value.split())):
        return "printable text, without control characters"
    return None


def _moves_the_cursor(text: str) -> bool:
    """Return whether a text holds control characters or unpaired surrogates."""
    return any(category(one) in ("Cc", "Cs") for one in text)
