"""What the evaluation of a settled point costs: ``python -m benchmarks.points [--json]``.

The points of the shipped backbones are evaluated anew from their recordings, beside what no evaluation can do without: the
harmonics of the oscillator's phase and one product of them with the samples of all channels. Processor time, on one core.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import typer

import rig
from benchmarks.frame import in_turn, on_one_core, show
from rig.bench import load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.evaluation.acceptance import modal_point
from rig.campaigns.evaluation.recorded import point_rows
from rig.campaigns.evaluation.vibrations import recorded_vibration
from rig.campaigns.plans import load_plan

ROUNDS = 15
"""Measurements of each kind, of which the median counts; chosen."""
BENCHES = ("magnet-beam", "friction-beam")


def work_of(name: str, folder: Path) -> dict[str, Callable[[], float]]:
    """Evaluations of all points of a bench's backbone, and the products; each returns its processor time, ms a point."""
    bench, plan = load_bench(name), load_plan(f"{name}/backbone")
    assert isinstance(plan, BackbonePlan)
    with rig.run(plan, output=folder / f"{name}.h5") as run:
        records = [point_rows(run.recording, number) for number in run.recording.latest]
    orders, target = 1j * np.arange(plan.harmonics + 1)[:, None], plan.targets()[0]

    def evaluate(rows: np.ndarray) -> None:
        modal_point(plan, target, bench, recorded_vibration(bench, rows, plan.harmonics), rows)

    def product(rows: np.ndarray) -> None:
        np.exp(orders * rows["theta_rad"].astype(float)) @ rows["inputs"].astype(float)

    def timed(one: Callable[[np.ndarray], None]) -> Callable[[], float]:
        def once() -> float:
            start = time.thread_time()
            for rows in records:
                one(rows)
            return 1e3 * (time.thread_time() - start) / len(records)

        return once

    return {"evaluation": timed(evaluate), "product": timed(product)}


def main(json: bool = False) -> None:
    """Measure both in turn."""
    on_one_core()
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in BENCHES:
            times = in_turn(work_of(name, Path(folder)), ROUNDS)
            found[name] = {
                "evaluation_ms": statistics.median(times["evaluation"]),
                "least_ms": min(times["evaluation"]),
                "evaluation_over_product": statistics.median(np.divide(times["evaluation"], times["product"]).tolist()),
            }
    show(found, json)


if __name__ == "__main__":
    typer.run(main)
