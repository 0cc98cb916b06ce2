"""Send millions of hostile bytes to both ends of both wires, and print what came of them.

``python -m tests.reliability.frames [--bytes 10000000] [--seed 1] [--jobs 2]``
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product

from tests.reliability.frames.hostile import ENDS, MODES, Counts, hostile_bytes
from tests.reliability.frames.lines import LINES

Cell = tuple[str, str, str]
SHARES = {("serial", "damaged"): 0.3, ("serial", "forged"): 0.4, ("can", "damaged"): 0.01, ("can", "forged"): 0.3}
"""Of the bytes at one end. What a bus damages is lost whole, so that few bytes are many frames."""


def table(found: dict[Cell, Counts]) -> list[str]:
    """Bytes, frames and runs by wire, end and mode, and what was wrong."""
    lines = [
        "| wire | end | frames | bytes | number | runs | carried out | by an error | rows wrong | else wrong | memory, MB |",
        "|" + "---|" * 11,
    ]
    for (wire, end, mode), one in found.items():
        done = one.ended["carried out"]
        lines.append(
            f"| {wire} | {end} | {mode} | {one.n_bytes} | {one.frames} | {one.runs} | {done} | {one.runs - done} | "
            f"{one.rows_wrong} | {len(one.wrong)} | {one.grown_mb:+.1f} |"
        )
    return lines


def main() -> int:
    """Send, and print."""
    parser = argparse.ArgumentParser(description="Hostile frames at both ends of both wires.")
    parser.add_argument(
        "--bytes", type=int, default=10_000_000, help="at each end, over both wires and kinds of frames"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    wanted = parser.parse_args()
    cells = [*product(LINES, ENDS, MODES)]
    shares = [int(SHARES[wire, mode] * wanted.bytes) for wire, _, mode in cells]
    columns: Sequence[Sequence[str]] = [*zip(*cells, strict=True)]
    with ProcessPoolExecutor(wanted.jobs) as pool:
        counts = pool.map(hostile_bytes, *columns, shares, [wanted.seed] * len(cells))
        found = dict(zip(cells, counts, strict=True))
    for cell, one in found.items():
        for line in one.wrong[:20]:
            print(f"{', '.join(cell)}: {line}")
    print("\n".join(table(found)))
    return int(any(one.wrong or one.rows_wrong for one in found.values()))


if __name__ == "__main__":
    sys.exit(main())
