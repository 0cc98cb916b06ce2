"""A backbone over emulated devices, run after run: ``python -m benchmarks.repeated_attempts [--runs 2] [--retries 2] [PLAN]``.

The plan runs unchanged on an emulated serial device and on an emulated CAN FD device, each at wall-clock pace with the loop in
a process of its own, as often as asked, in turns. A row of the table is one run: points accepted, points that were measured
again and how many attempts were refused for what, held outputs and lost samples of the whole run, its length. ``--retries 0``
shows what the same machine makes of the plan without repetition.
"""

import argparse
import json
import sys
import time
from collections import Counter
from typing import Any

import rig
from benchmarks.wires import bench_behind
from rig.campaigns.plans import bench_of, load_plan

WIRES = ("serial", "can")


def run_once(wire: str, plan_name: str, retries: int, seed: int) -> dict[str, Any]:
    """One run over one wire."""
    plan = load_plan(plan_name).model_copy(update={"retries": retries})
    began = time.monotonic()
    with bench_behind(wire, bench_of(plan, plan_name), False) as bench, rig.run(plan, bench=bench, seed=seed) as done:
        recording = done.recording
        points = list(recording.latest.values())
        refused = [attempt for point in points for attempt in point.get("refused_before", ())]
        counters = Counter[str]()
        for part in recording.parts:
            counters.update((part.end or {}).get("counters", {}))
        return {
            "wire": wire,
            "accepted": sum(point["accepted"] for point in points),
            "planned": len(plan.targets()),
            "measured_again": [point["number"] + 1 for point in points if point.get("refused_before")],
            "refused_attempts": [attempt["reason"] for attempt in refused],
            "refused": {point["number"] + 1: point["reason"] for point in points if not point["accepted"]},
            "parts": len(recording.parts),
            "held": counters["output_held"],
            "lost": counters["lost_samples"],
            "samples": recording.n_rows,
            "ended": (recording.parts[-1].end or {}).get("text", "cut short"),
            "seconds": time.monotonic() - began,
        }


def line(number: int, run: dict[str, Any]) -> str:
    """A row of the table."""
    again = ", ".join(map(str, run["measured_again"])) or "-"
    points = f"{run['accepted']:>2}/{run['planned']:<2}"
    return (
        f"{number:>3}  {run['wire']:<6}  {points}  {len(run['refused_attempts']):>8}  {again:<16}  "
        f"{run['parts']:>5}  {run['held']:>6}  {run['lost']:>5}  {run['samples']:>8}  {run['seconds']:>5.0f}"
    )


def main() -> None:
    """Run and print a table, or JSON."""
    parser = argparse.ArgumentParser()
    parser.add_argument("plan", nargs="?", default="magnet-beam/backbone")
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--retries", type=int, default=2)
    parser.add_argument("--wire", choices=WIRES)
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    runs = []
    if not wanted.json:
        print("run  wire    points  attempts  measured again    parts    held   lost   samples      s")
        print("                     refused")
    for number in range(wanted.runs):
        for wire in [wanted.wire] if wanted.wire else WIRES:
            runs.append(run_once(wire, wanted.plan, wanted.retries, number))
            if not wanted.json:
                print(line(number + 1, runs[-1]), flush=True)
                for reason in [*runs[-1]["refused_attempts"], *runs[-1]["refused"].values()]:
                    print(f"       {reason}", flush=True)
    if wanted.json:
        json.dump(runs, sys.stdout, indent=2)


if __name__ == "__main__":
    main()
