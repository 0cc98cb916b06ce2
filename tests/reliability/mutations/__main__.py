"""Spoil many files, say what misbehaves, and print a table of counts.

``python -m tests.reliability.mutations --configurations 2000 [--seed 1] [--keep FOLDER]``
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from rig.printable import one_line
from tests.reliability.mutations.configurations import compiled, judge, spoilt_configurations

OUTCOMES = ("refused", "accepted", "misbehaved")


def main() -> int:
    """Judge so many spoilt files; 1 where one misbehaved."""
    parser = argparse.ArgumentParser(description="Spoil files by a seed and judge what comes of them.")
    parser.add_argument("--configurations", type=int, default=0, metavar="N", help="benches and plans")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where files that misbehave are kept")
    wanted = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    slowest = 0.0
    with TemporaryDirectory() as folder:
        compiled(Path(folder))
        for number, spoilt in enumerate(spoilt_configurations(wanted.configurations, wanted.seed)):
            verdict = judge(spoilt, Path(folder))
            slowest = max(slowest, verdict.cpu_s)
            for mutation in {*spoilt.mutations, "all"}:
                counts[mutation, verdict.outcome] += 1
            if verdict.outcome != "misbehaved":
                continue
            print(f"{number}: {spoilt.name}, {', '.join(spoilt.mutations)}: {one_line(verdict.text)}", flush=True)
            if wanted.keep:
                wanted.keep.mkdir(parents=True, exist_ok=True)
                (wanted.keep / f"{number}.toml").write_bytes(spoilt.data)
    print(f"{'configurations':20}" + "".join(f"{name:>12}" for name in OUTCOMES))
    for mutation in sorted({name for name, _ in counts}):
        print(f"{mutation:20}" + "".join(f"{counts[mutation, outcome]:>12}" for outcome in OUTCOMES))
    print(f"slowest {slowest:.2f} s of CPU time")
    return 1 if counts["all", "misbehaved"] else 0


if __name__ == "__main__":
    sys.exit(main())
