"""Tables and JSON documents on standard output, and the same as blocks of a document."""

import contextlib
import io
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rig.text.column import Column
from vibrolock.printable import printable


@dataclass(frozen=True)
class PrintedTable:
    """A table as it was given to `print_table`."""

    headings: tuple[str, ...]
    """One for each column."""
    rows: tuple[tuple[str, ...], ...]
    """The cells, row by row."""


class _Collector(io.StringIO):
    """Standard output that keeps lines and tables apart."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks: list[str | PrintedTable] = []

    def take_lines(self) -> None:
        """Turn the text so far into one block for each line; empty lines are left out."""
        self.blocks += [line.rstrip() for line in self.getvalue().split("\n") if line.strip()]
        self.seek(0)
        self.truncate()


@contextlib.contextmanager
def collected() -> Iterator[list[str | PrintedTable]]:
    """Collect what is printed, line by line and table by table, instead of showing it; for documents with the same content.

    The list is filled when the context ends.
    """
    collector = _Collector()
    with contextlib.redirect_stdout(collector):
        yield collector.blocks
        collector.take_lines()


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON document on standard output; numbers that are not finite become null."""
    print(json.dumps(finite(value), indent=2))


def finite(value: object) -> object:
    """Return a JSON value with null for numbers that are not finite."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def number(value: float | None, pattern: str, scale: float = 1.0) -> str:
    """Return a number in a format, or a dash for None or NaN."""
    return "-" if value is None or value != value else format(scale * value, pattern)


def print_columns(*columns: tuple[str, str, Iterable[Any]]) -> None:
    """Print a table from heading, format and values of each column: text without a format, dashes for None and NaN."""
    cells = [[number(value, pattern) if pattern else value for value in values] for _, pattern, values in columns]
    print_table([heading for heading, _, _ in columns], list(zip(*cells, strict=True)))


def print_rows(rows: Sequence[Mapping[str, Any]], *columns: Column) -> None:
    """Print a table of fields of the rows; those of columns without a format are text."""
    print_table([column.title for column in columns], [cells_of(row, columns) for row in rows])


def cells_of(row: Mapping[str, Any], columns: Iterable[Column]) -> list[str]:
    """Return the fields of a row as text; those of columns without a format as they are."""
    return [number(row[one.key], one.pattern, one.scale) if one.pattern else str(row[one.key]) for one in columns]


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of right-aligned columns."""
    if isinstance(sys.stdout, _Collector):
        sys.stdout.take_lines()
        sys.stdout.blocks.append(PrintedTable(tuple(headings), tuple(map(tuple, rows))))
        return
    lines = [[printable(cell) for cell in row] for row in [headings, *rows]]
    widths = [max(len(row[column]) for row in lines) for column in range(len(headings))]
    for row in lines:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
