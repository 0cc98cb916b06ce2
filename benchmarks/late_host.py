"""Backbones while the host is late, on the virtual device: ``python -m benchmarks.late_host [--runs 100] [--blocks 5]``.

A part of all blocks of outputs comes too late, by up to ``--blocks`` blocks each time; the device goes on with the last period
(``late``) or, with ``--held``, holds its output. Against harmonic balance: the points accepted, the attempts that were refused,
and the largest errors of frequency and damping over all runs.
"""

import argparse
from typing import NamedTuple

import numpy as np

import rig
from identification import nonlinear_mode
from rig.campaigns.evaluation.recorded import points_of
from tests.reference.harmonic_balance import backbone_at_voltages
from tests.reference.parameters import ONE_SIDED
from tests.rig.rigs import bench_with

SHARES = (1e-4, 1e-3, 1e-2)
PLAN = "magnet-beam/backbone"
BLOCK = 10


class Outcome(NamedTuple):
    """What came of one run."""

    accepted: int
    points: int
    refused: int
    late: float
    """Part of the samples with a late output."""
    frequency: float
    """Largest relative error of the accepted points."""
    damping: float


def run_once(share: float, blocks: int, seed: int, kind: str) -> Outcome:
    """Return what came of a run with a ``share`` of late blocks, ``blocks`` at a time."""
    bench = bench_with({"block": BLOCK}, queue_blocks=2)
    block_s = BLOCK / bench.sample_rate_hz
    faults = {f"{kind}_per_s": share / blocks / block_s, f"{kind}_s": blocks * block_s}
    bench = bench_with({"block": BLOCK}, queue_blocks=2, faults=faults)
    with rig.run(PLAN, bench=bench, seed=seed) as run:
        points = points_of(run.recording)
        good = [point for point in points if point.accepted]
        counters = run.recording.parts[-1].end["counters"]
        late = (counters["output_held"] + counters["output_continued"]) / run.recording.n_rows
        refused = sum(len(point.refused_before) for point in points)
        if not good:
            return Outcome(0, len(points), refused, late, np.nan, np.nan)
        mode, truth = nonlinear_mode(run.backbone()), backbone_at_voltages(ONE_SIDED, [point.level for point in good])
    frequency = mode.frequency_hz / np.array([one.frequency_hz for one in truth]) - 1.0
    damping = mode.damping_ratio / np.array([one.damping_ratio for one in truth]) - 1.0
    return Outcome(len(good), len(points), refused, late, np.abs(frequency).max(), np.abs(damping).max())


def main() -> None:
    """Run, and print a row for each share."""
    parser = argparse.ArgumentParser(description="Backbones while the host is late.")
    parser.add_argument("--runs", type=int, default=100, help="in all")
    parser.add_argument("--blocks", type=int, default=5, help="of an interruption")
    parser.add_argument("--shares", type=float, nargs="+", default=list(SHARES), help="of all blocks that are late")
    parser.add_argument("--held", action="store_true", help="the device holds its output")
    wanted = parser.parse_args()
    kind = "held" if wanted.held else "late"
    print(f"{'late blocks':>11}  {'samples':>8}  runs  {'accepted':>11}  refused  {'frequency %':>11}  damping %")
    for number, share in enumerate(wanted.shares):
        seeds = range(number, wanted.runs, len(wanted.shares))
        found = [run_once(share, wanted.blocks, seed, kind) for seed in seeds]
        accepted = f"{sum(one.accepted for one in found)}/{sum(one.points for one in found)}"
        frequency, damping = (100.0 * np.nanmax([one[at] for one in found]) for at in (4, 5))
        print(
            f"{share:>11.0e}  {np.mean([one.late for one in found]):>8.2e}  {len(found):>4}  {accepted:>11}  "
            f"{sum(one.refused for one in found):>7}  {frequency:>11.4f}  {damping:>9.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
