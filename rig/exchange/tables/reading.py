"""Columns of a table in a text file, by name, with their units."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from identification.mapping import CsvLayout
from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import ChannelFacts, FileData, Value, from_variables
from rig.exchange.tables.heading import Heading, heading_of
from rig.exchange.tables.rows import Columns, RowFailed
from rig.exchange.tables.text import blocks, encoding_of, table_lines
from vibrolock.arrays import Float

_MOST_LAST = 50  # lines at the end that a message tells to leave out; chosen
Blocks = Iterator[tuple[int, str]]
"""Blocks of lines, each with the number of its first line."""


def read_table(path: Path, layout: CsvLayout | None = None) -> FileData:
    """Return the columns of a table by name: float64[n], or a text for a column of texts; and the units that it gives.

    Without a ``layout``, separators are comma, semicolon or tab, and the first line contains the names. Lines that begin with
    ``#`` are skipped. Lines of units (texts, or a 1) may follow the names. Separators at the ends of lines count for nothing,
    nor do lines of the heading that are repeated. Raises `ImportFailed`, with line and column, for anything that is not a
    number, for rows of unequal length, and for decimal commas unless the layout has them.
    """
    layout = layout or CsvLayout()
    encoding = layout.encoding or encoding_of(path)
    try:
        heading, rest = _split(blocks(path, "utf-8-sig" if encoding == "utf-8" else encoding), layout)
        if heading is None:
            raise ImportFailed("holds no table; expected a line of names, then rows of numbers")
        numbers = _columns(heading.columns, rest, layout.skip_last_lines)
    except ImportFailed as error:
        if str(error).startswith(str(path)):
            raise
        raise ImportFailed(f"{path}{', ' if str(error).startswith('line ') else ': '}{error}") from None
    columns = heading.columns
    values: dict[str, Value] = {columns.names[at]: f"<texts such as {heading.first[at]!r}>" for at in columns.texts}
    values |= {columns.names[at]: column for at, column in zip(columns.numeric, numbers, strict=True)}
    facts = {name: ChannelFacts(unit=unit) for name, unit in heading.units.items()}
    return from_variables({name: values[name] for name in columns.names}, facts)


def _split(found: Blocks, layout: CsvLayout) -> tuple[Heading | None, Blocks]:
    """Return the heading, None if there is no row of numbers, and the blocks from the first row on."""
    text, number = "", 1
    for number, block in found:
        text, number = text + block, number - text.count("\n")
        heading = heading_of([*table_lines(iter([(number, text)]))], layout)
        if heading is not None:
            lines = text.split("\n")
            return heading, chain([(heading.row, "\n".join(lines[heading.row - number :]))], found)
    return None, iter(())


def _columns(columns: Columns, found: Blocks, last: int) -> list[Float]:
    """Return float64[n] of each numeric column, without so many lines at the end."""
    parts: list[Float] = []
    for first, block in _without_last(found, last):
        try:
            parts.append(columns.rows(block, first))
        except RowFailed as error:
            raise _advised(error, columns, chain([(first, block)], found)) from None
    count = sum(map(len, parts))
    if not count:
        raise ImportFailed("holds names, but no row of numbers")
    whole = np.empty((len(columns.numeric), count))
    at = 0
    while parts:  # each part goes as soon as it is in its place
        part = parts.pop(0)
        whole[:, at : at + len(part)] = part.T
        at += len(part)
    return list(whole)


def _without_last(found: Blocks, last: int) -> Blocks:
    """Yield the blocks without so many lines of the table at the end."""
    if not last:
        yield from found
        return
    held: tuple[int, str] | None = None
    for first, block in found:
        if held is not None and sum(1 for _ in table_lines(iter([(first, block)]))) > last:
            yield held
            held = first, block
        else:
            held = (first, block) if held is None else (held[0], held[1] + block)
    if held is not None:
        lines = held[1].split("\n")
        rows = [number - held[0] for number, _ in table_lines(iter([held]))]
        yield held[0], "\n".join(lines[: rows[-last]] if last < len(rows) else [])


def _advised(error: RowFailed, columns: Columns, found: Blocks) -> ImportFailed:
    """Return the error, with what to do if all lines from this one to the end are few, and no rows of numbers."""
    count = 0
    for number, line in table_lines(found):
        if number < error.at_line:
            continue
        try:
            if columns.row(line, number):
                return error
        except ImportFailed:
            count += 1
        if count > _MOST_LAST:
            return error
    lines = "the last line" if count == 1 else f"the last {count} lines"
    return ImportFailed(f"{error}; to leave out {lines}, give `csv = {{ skip_last_lines = {count} }}`")
