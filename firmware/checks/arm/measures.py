"""Flash, RAM, stack and instructions of the core on a Cortex-M4, as tables of Markdown: ``make arm-measures``.

With ``--page`` they replace what stands on a page of documentation behind its heading "Measured". Needs arm-none-eabi-gcc with
newlib, and qemu-system-arm. Python's standard library is enough.
"""

import argparse
import datetime
import tempfile
from pathlib import Path

import instructions
import sizes
import stack
from tools import ARM, QEMU, output_of, variable

HEADING = "## Measured\n"


def report(build: Path) -> str:
    """All tables, under what they were measured with."""
    compiler, emulator = (output_of(name, "--version").splitlines()[0] for name in (f"{ARM}gcc", QEMU[0]))
    compiled = " ".join(variable("ARM") + variable("ARM_LIMITS"))
    return f"""{HEADING}
{datetime.datetime.now(datetime.UTC):%Y-%m-%d}, {compiler}, {emulator}; `{compiled}`.

### Flash and RAM

{sizes.report(build)}

### Stack

{stack.report(build)}

### Instructions

{instructions.report(build)}
"""


def main() -> None:
    """Print all tables, or put them on a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="page of documentation to put them on")
    page = parser.parse_args().page
    with tempfile.TemporaryDirectory() as folder:
        tables = report(Path(folder))
    if page is None:
        print(tables, end="")
    else:
        before = page.read_text(encoding="utf-8").partition(HEADING)[0]
        page.write_text(before + tables, encoding="utf-8")


if __name__ == "__main__":
    main()
