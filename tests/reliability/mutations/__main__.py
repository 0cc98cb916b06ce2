"""Spoil many files, say what misbehaves, and print a table of counts.

``python -m tests.reliability.mutations --configurations 2000 --files 2000 [--seed 1] [--keep FOLDER]``
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.reliability.mutations.configurations import compiled, judge, spoilt_configurations
from tests.reliability.mutations.files import FILE_OUTCOMES, contents_of, judge_file, originals, spoilt_files
from tests.reliability.mutations.judging import Verdict
from vibrolock.printable import one_line

OUTCOMES = ("refused", "accepted", "misbehaved")

Counts = Counter[tuple[str, str]]


class Keeper:
    """Says what misbehaves and keeps its files."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self.slowest_s = 0.0

    def take(self, name: str, verdict: Verdict, data: bytes) -> None:
        """Look at one verdict."""
        self.slowest_s = max(self.slowest_s, verdict.cpu_s)
        if verdict.outcome != "misbehaved":
            return
        print(f"{name}: {one_line(verdict.text)}", flush=True)
        if self._folder:
            self._folder.mkdir(parents=True, exist_ok=True)
            (self._folder / name.split(":")[0]).write_bytes(data)


def configurations(number: int, seed: int, keeper: Keeper) -> Counts:
    """Judge so many benches and plans."""
    counts: Counts = Counter()
    with TemporaryDirectory() as folder:
        compiled(Path(folder))
        for index, spoilt in enumerate(spoilt_configurations(number, seed)):
            verdict = judge(spoilt, Path(folder))
            counts.update((mutation, verdict.outcome) for mutation in {*spoilt.mutations, "all"})
            keeper.take(f"{index}.toml: {spoilt.name}, {', '.join(spoilt.mutations)}", verdict, spoilt.data)
    return counts


def files(number: int, seed: int, keeper: Keeper) -> Counts:
    """Judge so many recordings, journals, models and files of others."""
    counts: Counts = Counter()
    with TemporaryDirectory() as folder:
        whole = originals(Path(folder))
        content = contents_of(whole, Path(folder))
        for index, spoilt in enumerate(spoilt_files(number, seed, whole)):
            verdict = judge_file(spoilt, Path(folder), content)
            counts.update(((spoilt.kind, verdict.outcome), ("all", verdict.outcome)))
            keeper.take(f"{index}.{spoilt.kind}: {spoilt.mutation}", verdict, spoilt.data)
    return counts


def table(what: str, outcomes: Sequence[str], counts: Counts) -> list[str]:
    """The counts as a table."""
    lines = [f"| {what} | {' | '.join(outcomes)} |", "|---|" + "---|" * len(outcomes)]
    for name in sorted({name for name, _ in counts}):
        lines.append(f"| {name} | {' | '.join(str(counts[name, outcome]) for outcome in outcomes)} |")
    return lines


def main() -> int:
    """Judge so many spoilt files; 1 where one misbehaved."""
    parser = argparse.ArgumentParser(description="Spoil files by a seed and judge what comes of them.")
    parser.add_argument("--configurations", type=int, default=0, metavar="N", help="benches and plans")
    parser.add_argument(
        "--files", type=int, default=0, metavar="N", help="recordings, journals, models, MAT, universal files"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where files that misbehave are kept")
    wanted = parser.parse_args()
    keeper = Keeper(wanted.keep)
    misbehaved = 0
    for what, judge_all, number, outcomes in (
        ("configurations", configurations, wanted.configurations, OUTCOMES),
        ("files", files, wanted.files, FILE_OUTCOMES),
    ):
        if number:
            counts = judge_all(number, wanted.seed, keeper)
            misbehaved += counts["all", "misbehaved"]
            print("\n".join([*table(what, outcomes, counts), ""]))
    print(f"slowest {keeper.slowest_s:.2f} s of CPU time")
    return 1 if misbehaved else 0


if __name__ == "__main__":
    sys.exit(main())
