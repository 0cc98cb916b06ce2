"""Kill many runs, say what was lost, and print the counts as a table.

``python -m tests.reliability.kills [--number 200] [--seed 1] [--jobs 2]``
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.reliability.kills.cases import DEVICES, PHASES, Case, drawn
from tests.reliability.kills.killing import Outcome, carried_out


def killed(case: Case) -> Outcome:
    """One kill in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="vibrolock-kill-") as folder:
        return carried_out(case, Path(folder))


def table(found: Sequence[Outcome]) -> list[str]:
    """Kills by phase and device, and rows: noted as written, kept, lost or changed."""
    lines = [
        f"| killed | {' | '.join(DEVICES)} | rows written before | kills with something wrong |",
        "|---|" + "---|" * 6,
    ]
    for phase in PHASES:
        some = [one for one in found if one.case.phase == phase]
        counts = [sum(one.killed for one in some if one.case.device == device) for device in DEVICES]
        rows = sum(one.rows_noted for one in some)
        wrong = sum(bool(one.wrong) for one in some)
        lines.append(f"| {phase} | {' | '.join(map(str, counts))} | {rows} | {wrong} |")
    return lines


def main() -> int:
    """Kill, and print."""
    parser = argparse.ArgumentParser(description="Kill many runs and look what is left.")
    parser.add_argument("--number", type=int, default=200, help="kills")
    parser.add_argument("--seed", type=int, default=1, help="draws their places")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    wanted = parser.parse_args()
    found = []
    with ProcessPoolExecutor(wanted.jobs) as pool:
        for one in pool.map(killed, drawn(wanted.number, wanted.seed)):
            found.append(one)
            for line in one.wrong:
                print(f"{one.case.name}: {line}", flush=True)
    print("\n".join(table(found)))
    print(
        f"{sum(one.killed for one in found)} kills, {sum(bool(one.wrong) for one in found)} with something wrong",
        file=sys.stderr,
    )
    return int(any(one.wrong for one in found))


if __name__ == "__main__":
    sys.exit(main())
