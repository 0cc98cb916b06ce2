"""What a report consists of: chapters, sections, and the few kinds of blocks that the template knows."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar

from rig.text.console import PrintedTable
from vibrolock.printable import printable

_NUMERIC = re.compile(r"(|-|none|(>= )?[-+]?\d[\d.e+-]*( ?%)?( \([-+\d. %]+\))?)")
_DIGIT = re.compile(r"\d")
_SHORT = 14  # rows of a table that stays on one page of paper; chosen
_FACT = re.compile(r"(\S.{0,13}?| {10,}) {2,}(\S.*)")
_SIGNS = (("m/s^2", "m/s²"), ("+-", "±"), (">= ", "≥ "))


def typeset(value: object) -> str:
    """Return a value as the text of a page: printable, with the signs that a terminal may not have."""
    text = printable(str(value))
    for plain, sign in _SIGNS:
        text = text.replace(plain, sign)
    return text


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    text: str
    role: str = ""
    """How it is set: ``good``, ``bad``, ``note`` or plain."""


@dataclass(frozen=True)
class Facts:
    """Names and values."""

    kind: ClassVar[str] = "facts"
    caption: str
    """What they are; empty if the heading above says it."""
    rows: Sequence[tuple[str, str]]
    code: bool = False
    """Whether the names are keys of a file."""
    dense: bool = False
    """Whether they are set in two columns: many short ones."""


@dataclass(frozen=True)
class Table:
    """A table, whose first column names the rows."""

    kind: ClassVar[str] = "table"
    caption: str
    """What is in it."""
    headings: Sequence[str]
    """Of the columns; a line end parts a name from its unit."""
    rows: Sequence[Sequence[str]]
    marked: frozenset[int] = frozenset()
    """Rows that are set off: those of points that are not used, of tests that failed."""

    @property
    def short(self) -> bool:
        """Whether it is to stand on one page of paper."""
        return len(self.rows) <= _SHORT

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Whether each column has nothing but numbers."""
        return tuple(
            all(_NUMERIC.fullmatch(row[column]) for row in self.rows)
            and any(_DIGIT.search(row[column]) for row in self.rows)
            for column in range(len(self.headings))
        )


@dataclass(frozen=True)
class Picture:
    """A figure."""

    kind: ClassVar[str] = "picture"
    caption: str
    svg: str = ""
    """The figure as an element of the page."""
    source: str = ""
    """Or the figure as a data URI."""


Block = Text | Facts | Table | Picture


@dataclass
class Section:
    """A heading with blocks."""

    heading: str
    blocks: list[Block] = field(default_factory=list)
    """What stands below it."""


@dataclass
class Chapter:
    """All that a report says of one file, or of several together."""

    title: str
    subtitle: str
    lead: list[Block]
    """What somebody reads who reads nothing else."""
    sections: list[Section]
    """The rest; a section without blocks is left out."""

    @property
    def shown(self) -> list[Section]:
        """Sections that hold anything."""
        return [section for section in self.sections if section.blocks]


def blocks_of(printed: Sequence[str | PrintedTable], caption: str) -> list[Block]:
    """Return what was printed (`rig.text.console.collected`) as blocks.

    The line before a table is its caption unless it is indented. Lines of a name, two spaces or more, and a value are facts;
    so are lines that are indented as far as the values.
    """
    out: list[Block] = []
    for before, one in pairwise(["", *printed]):
        last = out[-1] if out else None
        if isinstance(one, PrintedTable):
            if isinstance(last, Text) and not last.role and not str(before).startswith(" "):
                out[-1] = Table(last.text, one.headings, one.rows)
            else:
                out.append(Table(caption, one.headings, one.rows))
        elif fact := _FACT.fullmatch(one):
            row = (fact[1].strip(), fact[2])
            if isinstance(last, Facts):
                out[-1] = Facts("", [*last.rows, row])
            else:
                out.append(Facts("", [row]))
        else:
            role = "note" if one.startswith(("note: ", "warning: ", "FINDING ")) else ""
            out.append(Text(one.strip(), role))
    return out
