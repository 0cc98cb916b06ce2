"""The race of methods: a backbone of 13 levels by each method, on six rigs, with noise and drift, against harmonic balance.

    python -m studies.methods run RUNS.jsonl [--seeds 2] [--rig NAME ...] [--condition NAME ...] [--method NAME ...]
    python -m studies.methods table RUNS.jsonl [--page docs/reference/race-of-methods.md]
    python -m studies.methods figure RUNS.jsonl -o race.png

``run`` takes about half an hour for all; it goes on where it ended. Each method has one knob, which trades time for accuracy.
It runs with the value that a person would begin with, and then with half or twice of it, until the cheapest value is known
with which all levels are within 0.02 % of the frequency and 2 % of the damping.
"""

import argparse
from pathlib import Path

from studies.methods.plans import METHODS
from studies.methods.race import Runs, cells, race
from studies.methods.rigs import CONDITIONS, RIGS


def main() -> None:
    """Entry."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.methods", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="run what is not in the file yet")
    running.add_argument("--seeds", type=int, default=2)
    running.add_argument("--rig", action="append", choices=RIGS)
    running.add_argument("--condition", action="append", choices=tuple(CONDITIONS))
    running.add_argument("--method", action="append", choices=tuple(METHODS))
    showing = commands.add_parser("table", help="print the tables, or put them into a page")
    showing.add_argument("--page", type=Path)
    drawing = commands.add_parser("figure", help="draw periods of vibration and errors")
    drawing.add_argument("-o", "--output", type=Path, required=True)
    for command in (running, showing, drawing):
        command.add_argument("runs", type=Path)
    asked = parser.parse_args()
    runs = Runs(asked.runs)
    if asked.command == "run":
        wanted = cells(tuple(asked.rig or RIGS), tuple(asked.condition or CONDITIONS))
        race(runs, asked.seeds, (cell for cell in wanted if not asked.method or cell[1] in asked.method))
    elif asked.command == "table":
        from studies.methods.table import put, tables

        text = tables(runs)
        print(text) if asked.page is None else put(asked.page, text)
    else:
        from studies.methods.figure import draw

        draw(runs, asked.output)


if __name__ == "__main__":
    main()
