"""The whole campaign: kills, places, spoilt files, hostile frames and a soak; its tables are written into the documentation.

``python -m tests.reliability [--write docs/reference/reliability.md] [--only kills places mutations frames soak]``; the fault
matrix and the count of false trips have their own commands (``tests.reliability.faults``, ``tests.reliability.false_trips``).
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.reliability.pages import between, measured

ROOT = Path(__file__).parents[2]
LONG = {
    "kills": ("--number", "200"),
    "places": (),
    "mutations": ("--configurations", "500", "--files", "2000"),
    "frames": ("--bytes", "10000000"),
    "soak": ("--minutes", "60", "--rate", "2000", "--block", "100"),
}
"""The parts of the campaign, and what they are asked for."""


def marks(part: str) -> tuple[str, str]:
    """Between which the table of a part stands on the page."""
    return f"<!-- begin of {part} -->", f"<!-- end of {part} -->"


def tables_in(output: str) -> str:
    """The lines of the tables that a command has printed, with blank lines between them."""
    lines = [line if line.startswith("|") else "" for line in output.splitlines()]
    return "\n".join(line for line, before in zip(lines, ["", *lines], strict=False) if line or before)


def carried_out(part: str, asked: tuple[str, ...], say: Callable[[str], object] = print) -> tuple[int, str]:
    """Carry out one part in a process of its own; its status and what it printed."""
    command = [sys.executable, "-m", f"tests.reliability.{part}", *asked]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    say(f"{part}: status {done.returncode}\n{done.stdout}")
    return done.returncode, done.stdout


def main() -> int:
    """Carry out what is asked for, write its tables; 1 where anything was wrong."""
    parser = argparse.ArgumentParser(description="The whole reliability campaign.")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="page that the tables are written into")
    parser.add_argument("--only", nargs="+", choices=LONG, default=[*LONG], metavar="PART", help=", ".join(LONG))
    wanted = parser.parse_args()
    status = 0
    for part in wanted.only:
        failed, output = carried_out(part, LONG[part])
        status |= failed
        if wanted.write and (tables := tables_in(output)):
            text = wanted.write.read_text(encoding="utf-8")
            told = f"`python -m tests.reliability.{' '.join((part, *LONG[part]))}`. {measured()}"
            wanted.write.write_text(between(text, *marks(part), f"{told}\n\n{tables}"), encoding="utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main())
