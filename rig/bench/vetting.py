"""Checks of a user's table, independent of its meaning, before a model reads it.

Models can then rely on numbers whose squares do not overflow, on texts without control characters and on limited nesting.
"""

from collections.abc import Iterator
from unicodedata import category

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


def objection_to(table: object) -> str | None:
    """Return path and fault of the first value that is not allowed; None if all values are allowed."""
    for path, depth, value in _values(table):
        fault = _fault(value) if depth <= DEEPEST else f"is nested too deeply: allowed are up to {DEEPEST} levels"
        if fault is not None:
            return f"{path} {fault}".strip()
    return None


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


def _fault(value: object) -> str | None:
    """Return the fault of one value, or None."""
    if isinstance(value, dict):
        wrong = next((key for key in value if not isinstance(key, str) or not _is_a_key(key)), None)
        what = f"a printable name of up to {LONGEST_KEY} characters"
        return None if wrong is None else f"holds the key {shown(wrong)}: allowed is {what}"
    if isinstance(value, bool):
        return None
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        return f"= a number of {value.bit_length()} bits: allowed is up to {LARGEST_INTEGER}"
    if isinstance(value, float) and not (value == 0.0 or SMALLEST <= abs(value) <= LARGEST):
        if value != value or abs(value) == float("inf"):
            return f"= {value!r}: allowed is a finite number"
        return f"= {value!r}: allowed is 0, or a size from {SMALLEST:g} to {LARGEST:g}"
    if isinstance(value, str):
        return _fault_of_text(value)
    return None


def _is_a_key(key: str) -> bool:
    return len(key) <= LONGEST_KEY and not _moves_the_cursor(key)


def _fault_of_text(text: str) -> str | None:
    if len(text) > LONGEST_TEXT:
        return f"= {shown(text)}: allowed are up to {LONGEST_TEXT} characters"
    if not text.isprintable() and _moves_the_cursor("".join(text.split())):
        return f"= {shown(text)}: holds a control character, allowed is printable text"
    return None


def _moves_the_cursor(text: str) -> bool:
    """Return whether a text holds control characters or unpaired surrogates."""
    return any(category(one) in ("Cc", "Cs") for one in text)
