"""The page with the measured ways to run, made from the rows: ``python -m tests.docs.ways_to_run --write``."""

import re
import sys

from rig.text.console import PrintedTable, collected
from studies.matrix.rows import read_rows
from studies.matrix.table import print_matrix
from tests.docs.pages import ROOT

ROWS = ROOT / "docs" / "reference" / "ways-to-run.toml"
PAGE = ROOT / "docs" / "reference" / "ways-to-run.md"
MARKS = "<!-- made from ways-to-run.toml -->", "<!-- end of what is made -->"


def made() -> str:
    """What stands between the marks of the page."""
    with collected() as blocks:
        print_matrix(read_rows(ROWS))
    out = []
    for block in blocks:
        if isinstance(block, PrintedTable):
            out += ["| " + " | ".join(block.headings) + " |", "|" + "---|" * len(block.headings)]
            out += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in block.rows]
        else:
            out += ["", block.replace("[", "\\[").replace("]", "\\]")]
    return "\n".join(out)


def parts() -> tuple[str, str, str]:
    """The page before, between and behind the marks."""
    found = re.fullmatch(rf"(.*?{MARKS[0]}\n)(.*)(\n{MARKS[1]}.*)", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1], found[2], found[3]


if __name__ == "__main__" and "--write" in sys.argv:
    before, _, behind = parts()
    PAGE.write_text(before + made() + behind, encoding="utf-8")
