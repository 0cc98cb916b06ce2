"""Layout of a text file with a table, guessed from its first and last lines."""

import re
from collections import deque
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Literal, get_args

from identification.mapping import CsvLayout, Encoding
from rig.exchange.child_reading import ImportFailed
from rig.exchange.tables.clocks import is_clock
from rig.exchange.tables.heading import are_units_above
from rig.exchange.tables.rows import cells_of
from rig.exchange.tables.text import blocks, encoding_of, table_lines
from vibrolock.quantities import quantity

_LABEL = re.compile(r"units?\s*[:=]\s*", re.IGNORECASE)  # ahead of units in a comment
_EXAMINED_LINES = 100  # lines that are examined at the beginning and at the end; chosen
_EQUAL_ROWS = 3  # rows of equally many numbers that make a table; chosen
_TRIED: tuple[tuple[Literal[",", ";", "\t", " "], Literal[".", ","]], ...] = (
    *((",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ","), (",", ","), (" ", "."), (" ", ",")),
)
"""Separators with decimal points or commas, in the order in which they are tried."""
_NUMBER = {
    ".": re.compile(r"[+-]?(\d++\.?\d*+|\.\d++)([eE][+-]?\d++)?$"),
    ",": re.compile(r"[+-]?(\d++,?\d*+|,\d++)([eE][+-]?\d++)?$"),
}


def guessed_layout(path: Path) -> CsvLayout | None:
    """Return the layout; None if the file needs none: UTF-8, one line of names (and one of units), then numbers alone.

    None as well if no table is found. Raises `ImportFailed` for what is no text.
    """
    encoding = encoding_of(path)
    numbered = [*islice(table_lines(blocks(path, encoding)), _EXAMINED_LINES)]
    lines = [line for _, line in numbered]
    for texts in (False, True):  # whether columns may hold texts
        for separator, decimal in _TRIED:
            first = _first_row(lines, separator, decimal, texts)
            if first is not None:
                above = _comments(path, encoding, numbered[first][0])
                return _layout(path, encoding, lines, first, separator, decimal, above)
    return None


def _layout(
    path: Path,
    encoding: str,
    lines: Sequence[str],
    first: int,
    separator: Literal[",", ";", "\t", " "],
    decimal: Literal[".", ","],
    comments: Sequence[str],
) -> CsvLayout | None:
    width = len(_cells(lines[first], separator))
    heading = next((at for at in (first - 1, first - 2) if at >= 0 and _names(lines[at], separator, width)), None)
    if heading is not None and heading > 0 and _has_unit(lines[heading], separator):
        heading -= 1 if _names(lines[heading - 1], separator, width) else 0
    if heading and are_units_above(_cells(lines[heading - 1], separator), _cells(lines[heading], separator)):
        heading -= 1
    names = _told_names(
        [] if heading is None else _cells(lines[heading], separator), lines[:first], comments, separator, width
    )
    last = _lines_after(path, encoding, separator, decimal, _shape(lines[first], separator, decimal))
    told = encoding.removesuffix("-sig")
    plain = separator in (",", ";", "\t") and decimal == "." and not last and told == "utf-8"
    if plain and heading == 0 and not names:
        return None
    if names:
        heading = None
    elif heading is None:
        names = tuple(f"column{number}" for number in range(1, width + 1))
    return CsvLayout(
        skip_lines=first if heading is None else heading,
        skip_last_lines=last,
        names=names or None,
        separator=separator,
        decimal=decimal,
        encoding=None if told == "utf-8" else next(one for one in get_args(Encoding) if one == told),
    )


def _comments(path: Path, encoding: str, row: int) -> list[str]:
    """Return the comments above a row, the last one first."""
    lines = next(blocks(path, encoding))[1].split("\n")[: row - 1]
    return [line.lstrip("# ").strip() for line in reversed(lines) if line.startswith("#")]


def _told_names(
    names: Sequence[str], above: Sequence[str], comments: Sequence[str], separator: str, width: int
) -> tuple[str, ...]:
    """Return the names of the columns, with units in brackets, where a comment tells names or units; else nothing.

    So do names that two spaces and more separate, above numbers that spaces separate.
    """
    if not names:
        wide = (
            [re.split(r"\s{2,}|\t", line.strip()) for line in (*above[-1:], *comments[:1])] if separator == " " else []
        )
        rows = [*wide, *(_cells(line, separator) for line in comments)]
        return next((tuple(cells) for cells in rows if _are_names(cells, width)), ())
    for line in comments:
        cells = [cell.strip("[]() ") for cell in _cells(_LABEL.sub("", line), separator)]
        if len(cells) == width and all(not cell or quantity(cell) is not None for cell in cells):
            return tuple(f"{name} [{cell}]" if cell else name for name, cell in zip(names, cells, strict=True))
    return ()


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without empty ones at its end."""
    try:
        cells = [cell.strip() for cell in cells_of(line, separator)]
    except ImportFailed:
        return [line]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _first_row(lines: Sequence[str], separator: str, decimal: str, texts: bool) -> int | None:
    """Return the first of several rows of equally many numbers, two at least, with texts only where all have texts."""
    shapes = [_shape(line, separator, decimal) for line in lines]
    shapes = [one if one.count("n") > 1 and (texts or "t" not in one) else "" for one in shapes]
    for at in range(len(shapes)):
        some = shapes[at : at + _EQUAL_ROWS]
        if some[0] and len(set(some)) == 1 and (len(some) == _EQUAL_ROWS or at == 0):
            return at
    return None


def _shape(line: str, separator: str, decimal: str) -> str:
    """Return a letter for each cell of a line: n for a number, t for a text."""
    numbers = (
        bool(_NUMBER[decimal].match(cell)) or cell.lower() == "nan" or is_clock(cell)
        for cell in _cells(line, separator)
    )
    return "".join("n" if number else "t" for number in numbers)


def _lines_after(path: Path, encoding: str, separator: str, decimal: str, shape: str) -> int:
    """Return how many lines at the end have another shape than the rows of numbers."""
    end = [line for _, line in table_lines(iter(deque(blocks(path, encoding), 2)))]
    for count, line in enumerate(reversed(end[-_EXAMINED_LINES:])):
        if _shape(line, separator, decimal) == shape:
            return count
    return 0


def _has_unit(line: str, separator: str) -> bool:
    return any(quantity(cell) is not None for cell in _cells(line, separator))


def _names(line: str, separator: str, width: int) -> bool:
    """Return whether a line may name the columns: as many different texts, none of them a number."""
    return _are_names(_cells(line, separator), width)


def _are_names(cells: Sequence[str], width: int) -> bool:
    texts = all(cell and not _NUMBER["."].match(cell) for cell in cells)
    return len(cells) == width and len(set(cells)) == width and texts
