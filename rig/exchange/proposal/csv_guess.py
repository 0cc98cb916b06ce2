"""Layout of a CSV file that does not begin with one line of names, guessed from its first lines."""

import csv
import re
from itertools import islice
from pathlib import Path
from typing import Literal

from identification.mapping import UNITS, CsvLayout
from rig.exchange.csv import table_lines

_EXAMINED_LINES = 100  # lines that are examined; chosen
_EQUAL_ROWS = 3  # rows of equally many numbers that make a table; chosen
_TRIED: tuple[tuple[Literal[",", ";", "\t", " "], Literal[".", ","]], ...] = (
    *((",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ","), (" ", "."), (" ", ",")),
)
"""Separators with decimal points or commas, in the order in which they are tried."""
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?$"),
}


def guessed_layout(path: Path) -> CsvLayout | None:
    """Return the layout; None if the file begins with one line of names (and one of units), or no table is found."""
    lines = [line for _, line in islice(table_lines(path), _EXAMINED_LINES)]
    for separator, decimal in _TRIED:
        first = _first_row(lines, separator, decimal)
        if first is None:
            continue
        width = len(_cells(lines[first], separator))
        heading = next((at for at in (first - 1, first - 2) if at >= 0 and _names(lines[at], separator, width)), None)
        if heading is not None and heading > 0 and _has_unit(lines[heading], separator):
            heading -= 1 if _names(lines[heading - 1], separator, width) else 0
        plain = separator in (",", ";", "\t") and decimal == "."
        if plain and heading == 0:
            return None
        names = None if heading is not None else tuple(f"column{number}" for number in range(1, width + 1))
        skip = first if heading is None else heading
        return CsvLayout(skip_lines=skip, names=names, separator=separator, decimal=decimal)
    return None


def _cells(line: str, separator: str) -> list[str]:
    try:
        cells = line.split() if separator == " " else next(csv.reader([line], delimiter=separator))
    except csv.Error:
        return [line]
    return [cell.strip() for cell in cells]


def _first_row(lines: list[str], separator: str, decimal: str) -> int | None:
    """Return the first of several lines with equally many numbers, two at least."""
    widths = []
    for line in lines:
        cells = _cells(line, separator)
        widths.append(len(cells) if len(cells) > 1 and all(_NUMBER[decimal].match(cell) for cell in cells) else 0)
    for at in range(len(widths)):
        some = widths[at : at + _EQUAL_ROWS]
        if some[0] and len(set(some)) == 1 and (len(some) == _EQUAL_ROWS or at == 0):
            return at
    return None


def _has_unit(line: str, separator: str) -> bool:
    return any(cell.strip("[]() ") in {*UNITS, "s", "Hz"} for cell in _cells(line, separator))


def _names(line: str, separator: str, width: int) -> bool:
    """Return whether a line may name the columns: as many different texts, none of them a number."""
    cells = _cells(line, separator)
    texts = all(cell and not _NUMBER["."].match(cell) for cell in cells)
    return len(cells) == width and len(set(cells)) == width and texts
