"""Heading of a table in a text file: names and units of its columns."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.exchange.child_reading import ImportFailed
from rig.exchange.tables.clocks import is_clock
from rig.exchange.tables.rows import Columns, cells_of
from vibrolock.quantities import quantity

if TYPE_CHECKING:
    from identification.mapping import CsvLayout

_DIGIT_FIRST = re.compile(r"\s*[+-]?[.,]?\d")
Lines = Sequence[tuple[int, str]]
"""Lines of a table with their numbers."""


@dataclass(frozen=True, kw_only=True)
class Heading:
    """Names, units and the first row of a table."""

    columns: Columns
    units: Mapping[str, str]
    """Units by name, of the columns that have one."""
    row: int
    """Number of the line with the first row."""
    first: tuple[str, ...]
    """Cells of the first row."""


def heading_of(lines: Lines, layout: "CsvLayout") -> Heading | None:
    """Return the heading at the beginning of a table; None if it has no row of numbers.

    Raises `ImportFailed` if the first line does not name every column.
    """
    lines = lines[layout.skip_lines :]
    if not lines:
        return None
    separator = layout.separator or _separator(lines[0][1], layout.decimal)
    if (
        layout.names is None
        and len(lines) > 1
        and are_units_above(*(cells_of(line, separator) for _, line in lines[:2]))
    ):
        lines = [lines[1], lines[0], *lines[2:]]
    names = _names(lines[0][1], separator) if layout.names is None else layout.names
    plain = Columns(tuple(names), separator, layout.decimal)
    above = [] if layout.names is not None else [lines[0][1]]
    units: dict[str, str] = {}
    for at, (number, line) in enumerate(lines[len(above) :], len(above)):
        cells = [cell.strip() for cell in cells_of(line, separator)]
        if is_units(cells, layout.decimal):
            units |= {
                name: unit for name, unit in zip(names, map(_unit, cells), strict=False) if unit and name not in units
            }
            above.append(line)
            continue
        clocks = frozenset(column for column, cell in enumerate(cells[: len(names)]) if is_clock(cell))
        units |= {names[column]: "s" for column in clocks}
        columns = Columns(
            plain.names,
            separator,
            layout.decimal,
            texts=_texts(plain, [cells, *(cells_of(one, separator) for _, one in lines[at + 1 : at + 2])]) - clocks,
            clocks=clocks,
            extra=max(len(cells) - len(names), 0),
            heading=frozenset(one.strip() for one in above),
        )
        return Heading(columns=columns, units=units, row=number, first=tuple(cells))
    return None


def _names(line: str, separator: str) -> list[str]:
    names = [name.strip() for name in cells_of(line, separator)]
    while names and not names[-1]:
        names.pop()
    numbers = Columns((), separator, ".")
    if not names or len(set(names)) < len(names) or any(numbers.number(name) is not None for name in names):
        raise ImportFailed(f"the first line must name every column, each differently; it is '{line[:60]}'")
    return names


def _separator(line: str, decimal: str) -> str:
    return max(";\t" if decimal == "," else ",;\t", key=line.count)


def is_units(cells: Sequence[str], decimal: str = ".") -> bool:
    """Return whether a row holds units: texts that do not begin like a number, or a 1."""
    plain = Columns((), "", decimal)
    values = [plain.number(cell) for cell in cells]
    return None in values and all(
        cell == "1" if value is not None else not _DIGIT_FIRST.match(cell)
        for cell, value in zip(cells, values, strict=True)
    )


def are_units_above(first: Sequence[str], second: Sequence[str]) -> bool:
    """Return whether a row holds known units and nothing else, and the next one the names that belong to them."""
    return (
        len(first) == len(second)
        and any(cell.strip() for cell in first)
        and all(not cell.strip() or quantity(_unit(cell.strip())) is not None for cell in first)
        and all(cell.strip() and not _DIGIT_FIRST.match(cell) for cell in second)
        and any(quantity(cell) is None for cell in second)
    )


def _unit(cell: str) -> str:
    """Return a unit without brackets around it."""
    return cell[1:-1].strip() if (cell[:1], cell[-1:]) in (("[", "]"), ("(", ")")) else cell


def _texts(columns: Columns, rows: Sequence[Sequence[str]]) -> frozenset[int]:
    """Return the columns that hold texts in both of the first two rows, unless all do."""
    if len(rows) < 2 or any(len(row) < len(columns.names) for row in rows):
        return frozenset()
    found = {
        at
        for at in range(len(columns.names))
        if all(
            row[at].strip() and columns.number(row[at]) is None and not _DECIMAL.match(row[at].strip()) for row in rows
        )
    }
    return frozenset(found) if len(found) < len(columns.names) else frozenset()


_DECIMAL = re.compile(r"[+-]?\d*,\d+$")  # a number with a decimal comma, about which the reader advises
