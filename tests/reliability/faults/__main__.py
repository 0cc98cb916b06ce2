"""Carry out the whole fault matrix, say what keeps no bound, and write the tables of its page.

``python -m tests.reliability.faults [--write docs/reference/fault-matrix.md] [--jobs N] [--fault PART-OF-A-NAME]``
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.reliability.faults.bounds import objections
from tests.reliability.faults.matrix import CASES, Case
from tests.reliability.faults.observing import Observation, observe
from tests.reliability.faults.page import written
from tests.reliability.faults.plans import bench_for


def observed(cases: Sequence[Case]) -> list[Observation]:
    """What the faults of these cases do, one after the other."""
    return [observe(*case) for case in cases]


def main() -> int:
    """Carry out every case, say which keep no bound, write the page."""
    parser = argparse.ArgumentParser(description="Carry out the whole fault matrix.")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="page whose tables are written")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--fault", default="", help="only faults whose names contain this; nothing is written")
    wanted = parser.parse_args()
    cases = sorted((c for c in CASES if wanted.fault in c.fault.name), key=lambda case: (case.levels, case.device))
    parts = [cases[first :: wanted.jobs] for first in range(wanted.jobs)]
    with ProcessPoolExecutor(wanted.jobs) as pool:
        seen = {
            case: one
            for part, found in zip(parts, pool.map(observed, parts), strict=True)
            for case, one in zip(part, found, strict=True)
        }
    broken = 0
    for case, one in seen.items():
        wrong = objections(case, one, bench_for(case.levels))
        broken += bool(wrong)
        for line in wrong:
            print(f"{case.name}: {line}")
    print(f"{len(seen)} cases, {broken} beyond their bounds", file=sys.stderr)
    if wanted.write and not wanted.fault:
        text = wanted.write.read_text(encoding="utf-8")
        wanted.write.write_text(written(text, seen), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
