"""A backbone by the clock over emulated devices, run after run: ``python -m benchmarks.repeated_attempts [--runs 2] [PLAN]``.

The shipped plan runs unchanged on an emulated serial device and on an emulated CAN FD device, each at wall-clock pace with the
loop in a process of its own: one after the other, or both at once (``--together``), beside so many processes that compute
(``--beside``). A row of the table is one run: points accepted, attempts that were refused, outputs continued and held, samples
lost, the queue, the largest errors of frequency and damping against harmonic balance at the voltage of each point (magnet beam
with levels in volts alone), its length.
"""

import argparse
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from typing import Any

import numpy as np

import rig
from identification import nonlinear_mode
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.plans import bench_of, load_plan
from rig.emulator.emulated import emulated
from tests.reference.harmonic_balance import backbone_at_voltages
from tests.reference.parameters import ONE_SIDED

WIRES = ("serial", "can")
BLOCK = 10
TRUE_PLAN = "magnet-beam/backbone"
ENDLESS = "while True: sum(range(10000))"


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """So many processes of normal priority that compute."""
    with ExitStack() as stack:
        for _ in range(processes):
            one = subprocess.Popen([sys.executable, "-c", ENDLESS])
            stack.callback(one.wait)
            stack.callback(one.kill)
        yield


def errors(done: rig.Run) -> tuple[float, float]:
    """Largest relative errors of frequency and damping of the accepted points."""
    levels = [point.level for point in points_of(done.recording) if point.accepted]
    if not levels:
        return np.nan, np.nan
    mode, truth = nonlinear_mode(done.backbone()), backbone_at_voltages(ONE_SIDED, levels)
    frequency = mode.frequency_hz / np.array([one.frequency_hz for one in truth]) - 1.0
    damping = mode.damping_ratio / np.array([one.damping_ratio for one in truth]) - 1.0
    return float(np.abs(frequency).max()), float(np.abs(damping).max())


def run_once(wire: str, plan_name: str, seed: int, options: dict[str, Any]) -> dict[str, Any]:
    """One run over one wire."""
    plan = load_plan(plan_name)
    began = time.monotonic()
    bench = bench_of(plan, plan_name).model_copy(update={"block": BLOCK})
    with (
        emulated(bench, wire, lockstep=False, options=options) as reached,
        rig.run(plan, bench=reached, seed=seed) as done,
    ):
        recording = done.recording
        points = list(recording.latest.values())
        refused = [attempt for point in points for attempt in point.get("refused_before", ())]
        counters = Counter[str]()
        for part in recording.parts:
            counters.update((part.end or {}).get("counters", {}))
        frequency, damping = errors(done) if plan_name == TRUE_PLAN else (np.nan, np.nan)
        about = recording.parts[-1].information["about"]
        return {
            "wire": wire,
            "accepted": sum(point["accepted"] for point in points),
            "planned": len(plan.targets()),
            "refused_attempts": [attempt["reason"] for attempt in refused],
            "refused": {point["number"] + 1: point["reason"] for point in points if not point["accepted"]},
            "continued": counters["output_continued"],
            "held": counters["output_held"],
            "lost": counters["lost_samples"],
            "samples": recording.n_rows,
            "lead": about["lead_samples"],
            "frequency": frequency,
            "damping": damping,
            "ended": (recording.parts[-1].end or {}).get("text", "cut short"),
            "seconds": time.monotonic() - began,
        }


HEAD = (
    "run  wire    points  refused  continued    held    lost   samples  lead  frequency %  damping %    s\n"
    "                    attempts"
)


def line(number: int, run: dict[str, Any]) -> str:
    """A row of the table."""
    points = f"{run['accepted']:>2}/{run['planned']:<2}"
    return (
        f"{number:>3}  {run['wire']:<6}  {points}  {len(run['refused_attempts']):>8}  {run['continued']:>8}  "
        f"{run['held']:>6}  {run['lost']:>6}  {run['samples']:>8}  {run['lead']:>4.0f}  {100.0 * run['frequency']:>11.4f}  "
        f"{100.0 * run['damping']:>9.3f}  {run['seconds']:>3.0f}"
    )


def main() -> None:
    """Run and print a table, or JSON."""
    parser = argparse.ArgumentParser(description="A backbone by the clock over emulated devices.")
    parser.add_argument("plan", nargs="?", default=TRUE_PLAN)
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--wire", choices=WIRES)
    parser.add_argument("--queue", type=int, help="blocks; the driver's default without it")
    parser.add_argument("--together", action="store_true", help="both wires at once")
    parser.add_argument("--beside", type=int, default=0, metavar="N", help="processes that compute")
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    options = {} if wanted.queue is None else {"queue_blocks": wanted.queue}
    wires = [wanted.wire] if wanted.wire else [*WIRES]
    runs = []
    if not wanted.json:
        print(HEAD, flush=True)
    workers = ProcessPoolExecutor(len(wires) if wanted.together else 1, get_context("spawn"))
    with busy(wanted.beside), workers:
        for number in range(wanted.runs):
            asked = [workers.submit(run_once, wire, wanted.plan, number, options) for wire in wires]
            for run in (one.result() for one in asked):
                runs.append(run)
                if wanted.json:
                    continue
                print(line(number + 1, run), flush=True)
                for reason in [*run["refused_attempts"], *run["refused"].values()]:
                    print(f"       {reason}", flush=True)
                if run["accepted"] < run["planned"]:
                    print(f"       {run['ended']}", flush=True)
    if wanted.json:
        json.dump(runs, sys.stdout, indent=2)


if __name__ == "__main__":
    main()
