"""Backbones while the host is late, on the virtual device: ``python -m benchmarks.late_host [--runs 100] [--blocks 5]``.

A part of all blocks of outputs comes too late, by up to ``--blocks`` blocks each time; the device goes on with the last period
or, with ``--held``, holds its output. Against harmonic balance: the points accepted, the attempts that were refused,
and the largest errors of frequency and damping over all runs.
"""

from typing import Any

import numpy as np
import typer

import rig
from benchmarks.outcomes import PLAN, outcome
from rig.text.console import print_table
from tests.rig.rigs import bench_with

SHARES = (1e-4, 1e-3, 1e-2)
"""Parts of all blocks that are late; the runs are spread over them."""
BLOCK = 10
"""Samples a block."""


def run_once(share: float, blocks: int, seed: int, kind: str) -> dict[str, Any]:
    """Return what came of a run with a ``share`` of late blocks, ``blocks`` at a time."""
    bench = bench_with({"block": BLOCK}, queue_blocks=2)
    block_s = BLOCK / bench.sample_rate_hz
    faults = {f"{kind}_per_s": share / blocks / block_s, f"{kind}_s": blocks * block_s}
    with rig.run(PLAN, bench=bench_with({"block": BLOCK}, queue_blocks=2, faults=faults), seed=seed) as run:
        return outcome(run)


def main(runs: int = 100, blocks: int = 5, held: bool = False) -> None:
    """Carry out so many runs in all, with interruptions of ``blocks``; print a row for each share."""
    rows = []
    for number, share in enumerate(SHARES[:runs]):
        seeds = range(number, runs, len(SHARES))
        found = [run_once(share, blocks, seed, "held" if held else "late") for seed in seeds]
        late = np.mean([(one["held"] + one["continued"]) / one["samples"] for one in found])
        accepted, points = (sum(one[key] for one in found) for key in ("accepted", "points"))
        refused = sum(len(one["refused_attempts"]) for one in found)
        errors = [100.0 * np.nanmax([one[key] for one in found]) for key in ("frequency_error", "damping_error")]
        cells = (f"{share:g}", f"{late:.2e}", str(len(found)), f"{accepted}/{points}", str(refused))
        rows.append((*cells, f"{errors[0]:.4f}", f"{errors[1]:.3f}"))
    print_table(("late blocks", "samples", "runs", "accepted", "refused", "frequency %", "damping %"), rows)


if __name__ == "__main__":
    typer.run(main)
