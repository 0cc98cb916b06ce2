"""Flash, RAM, stack and instructions of the core on a Cortex-M4, as tables of Markdown: ``make arm-measures``.

Needs arm-none-eabi-gcc with newlib, and qemu-system-arm. Python's standard library is enough.
"""

import argparse
import tempfile
from pathlib import Path

import instructions
import sizes
import stack
from tools import ARM, OPTIMISATIONS, QEMU, output_of, variable


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--optimisations", nargs="+", default=OPTIMISATIONS, help="of the table of instructions")
    chosen = parser.parse_args()
    print(output_of(f"{ARM}gcc", "--version").splitlines()[0])
    print(output_of(QEMU[0], "--version").splitlines()[0])
    print(" ".join(variable("ARM") + variable("ARM_LIMITS")))
    with tempfile.TemporaryDirectory() as folder:
        build = Path(folder)
        for report in (sizes.report(build), stack.report(build), instructions.report(build, chosen.optimisations)):
            print(f"\n{report}", flush=True)


if __name__ == "__main__":
    main()
