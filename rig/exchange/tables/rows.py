"""Rows of numbers in text: by a compiled parser where they are plain, else cell by cell, with line and column of what is wrong.

Both give the same numbers, those that are nearest to what is printed.
"""

import csv
import io
import warnings
from array import array
from dataclasses import dataclass

import numpy as np

from rig.exchange.child_reading import ImportFailed
from rig.exchange.tables.clocks import in_seconds
from rig.exchange.tables.text import is_row
from vibrolock.arrays import Float


class RowFailed(ImportFailed):
    """A line of a table is no row of numbers."""

    def __init__(self, line: int, column: str, what: str) -> None:
        where = f"line {line}, column '{column}'" if column else f"line {line}"
        super().__init__(f"{where}: {what}")
        self.at_line = line
        """Number of the line, from 1."""


@dataclass(frozen=True)
class Columns:
    """Columns of a table, and how their numbers are written."""

    names: tuple[str, ...]
    separator: str
    """Comma, semicolon, tab, or a space for any number of them."""
    decimal: str
    texts: frozenset[int] = frozenset()
    """Numbers of the columns that hold texts, which are not read, from 0."""
    clocks: frozenset[int] = frozenset()
    """Numbers of the columns that hold times of day, which become seconds, from 0."""
    extra: int = 0
    """Separators at the end of each line, behind which nothing stands."""
    heading: frozenset[str] = frozenset()
    """Lines of the heading, which some programs repeat."""

    @property
    def numeric(self) -> list[int]:
        """Numbers of the columns that are read."""
        return [at for at in range(len(self.names)) if at not in self.texts]

    def rows(self, block: str, first: int) -> Float:
        """float[n, n_numeric]: the rows in a block of lines; ``first`` is the number of its first line.

        Raises `RowFailed`.
        """
        block = in_seconds(block, self.decimal) if self.clocks else block
        quick = self._quick(block)
        if quick is not None:
            return quick
        found = array("d")
        for number, line in enumerate(block.split("\n"), first):
            found.extend(self._plain(line) or self.row(line, number))
        return np.array(found).reshape(-1, len(self.numeric))

    def _plain(self, line: str) -> list[float]:
        """Return the numbers in a line that holds nothing else; empty for any other line."""
        cells = line.split(self.separator) if self.separator != " " else line.split()
        if len(cells) != len(self.names) or self.texts:
            return []
        try:
            return [*map(float, cells if self.decimal == "." else [cell.replace(",", ".") for cell in cells])]
        except ValueError:
            return []

    def row(self, line: str, number: int) -> list[float]:
        """Return the numbers in a line; empty for a comment, an empty line, or one of the heading."""
        if not is_row(line) or line.strip() in self.heading:
            return []
        cells = cells_of(in_seconds(line, self.decimal) if self.clocks else line, self.separator)
        count = len(self.names)
        if len(cells) < count or any(cell.strip() for cell in cells[count:]):
            wrong = next((cell for cell in cells if cell.strip() and self.number(cell) is None), "")
            told = f" ('{wrong[:60]}')" if wrong else ""
            raise RowFailed(number, "", f"{len(cells)} values for {count} names{told}")
        return [self._number_at(cells[at], number, self.names[at]) for at in self.numeric]

    def number(self, cell: str) -> float | None:
        """Return the number in a cell; None if it holds none."""
        try:
            return float(cell if self.decimal == "." else cell.replace(",", "."))
        except ValueError:
            return None

    def _number_at(self, cell: str, line: int, column: str) -> float:
        value = self.number(cell)
        if value is not None:
            return value
        if not cell.strip():
            raise RowFailed(line, column, "is empty; a number is expected in every row")
        hint = '; write decimals with a point, or give `csv = { decimal = "," }`' if "," in cell else ""
        raise RowFailed(line, column, f"'{cell.strip()[:60]}' is not a number{hint}")

    def _quick(self, block: str) -> Float | None:
        """Return the rows as pandas reads them; None without pandas, and for a block in which anything is unusual."""
        if self.separator == " " or any(sign in block for sign in "#\0\x1a\v\f"):
            return None
        try:
            import pandas as pd
        except ImportError:
            return None
        plain = block.replace(f"{self.separator * self.extra}\n", "\n") if self.extra else block
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # later versions know this precision alone, and say so
            try:
                frame = pd.read_csv(
                    io.StringIO(plain),
                    sep=self.separator,
                    decimal=self.decimal,
                    header=None,
                    index_col=False,
                    dtype=dict.fromkeys(self.numeric, np.float64),
                    float_precision="round_trip",
                    skipinitialspace=True,
                    na_filter=False,
                    low_memory=False,
                )
            except (ValueError, OverflowError):  # among them all errors of the parser
                return None
        if frame.shape[1] != len(self.names):
            return None
        return np.asarray(frame[self.numeric].to_numpy(np.float64))


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line; raise `ImportFailed` for one that is no line of a table."""
    try:
        return (
            line.split() if separator == " " else next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        )
    except (csv.Error, StopIteration) as error:
        raise ImportFailed(
            f"the line '{line[:40]} ...' of {len(line)} characters is not a line of a table ({error})"
        ) from None
