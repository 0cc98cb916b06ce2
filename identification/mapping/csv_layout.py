"""Layout of CSV files that do not begin with one line of names."""

from typing import Annotated, Literal

from pydantic import Field

from identification.mapping.base import MappingTable


class CsvLayout(MappingTable):
    """How a table of numbers is written."""

    skip_lines: Annotated[int, Field(ge=0)] = 0
    """Lines at the beginning that are no part of the table."""
    names: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Names of the columns; if left out, they are in the first line that is not skipped."""
    separator: Literal[",", ";", "\t", " "] | None = None
    """What separates columns (a space: any number of them); if left out, comma, semicolon or tab, whichever is commonest."""
    decimal: Literal[".", ","] = "."
    """Decimal point or comma."""
