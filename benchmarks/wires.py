"""One backbone over several wires, side by side: ``python -m benchmarks.wires [--lockstep] [--firmware PROGRAM] [PLAN]``.

The plan runs unchanged on the virtual rig, on an emulated serial device, and on emulated devices on CAN FD and classical CAN,
each in its own process, the emulators at wall-clock pace (or in lockstep); with ``--firmware`` that is run in their place.
Frequency and damping of every point are compared with those of the virtual rig, whose loop has neither the devices' queue nor
their blocks.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import rig
from rig.bench import Bench
from rig.campaigns.plans import bench_of, load_plan
from rig.emulator.emulated import emulated

BLOCK = 14
QUEUE = 2
WIRES: dict[str, dict[str, Any] | None] = {
    "virtual": None,
    "serial": {"wire": "serial"},
    "can": {"wire": "can"},
    "classical": {"wire": "can", "fd": False},
}


@contextmanager
def bench_behind(wire: dict[str, Any] | None, bench: Bench, lockstep: bool, firmware: str | None) -> Iterator[Bench]:
    """The bench itself, or an emulated device with it behind a wire."""
    if wire is None:
        yield bench
        return
    blocked = bench.model_copy(update={"block": BLOCK})
    with emulated(blocked, lockstep=lockstep, options={"queue_blocks": QUEUE}, firmware=firmware, **wire) as reached:
        yield reached


def measure(plan_name: str, lockstep: bool, firmware: str | None = None) -> dict[str, dict[str, Any]]:
    """Points and loop statistics by wire."""
    plan = load_plan(plan_name)
    out: dict[str, dict[str, Any]] = {}
    for name, wire in WIRES.items():
        behind = bench_behind(wire, bench_of(plan, plan_name), lockstep, firmware)
        with behind as bench, rig.run(plan, bench=bench) as done:
            latest = done.recording.latest
            points = [point for point in latest.values() if point["accepted"]]
            end = done.recording.parts[-1].end or {}
            out[name] = {
                "rate_hz": bench.sample_rate_hz,
                "block": bench.block,
                "number": [point["number"] for point in points],
                "refused": {point["number"]: point["reason"] for point in latest.values() if not point["accepted"]},
                "force_n": [point["force_n"] for point in points],
                "frequency_hz": [point["frequency_hz"] for point in points],
                "damping_ratio": [point["damping_ratio"] for point in points],
                "loop": end.get("loop", {}),
                "counters": end.get("counters", {}),
                "reason": end.get("text", ""),
            }
    return out


def compare(found: dict[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Largest differences from the virtual rig, percent, over the points that both have."""
    out = {}
    truth = found["virtual"]
    for name, one in found.items():
        _, mine, theirs = np.intersect1d(one["number"], truth["number"], return_indices=True)
        differ = {
            key: 100.0 * float(np.abs(np.array(one[key])[mine] / np.array(truth[key])[theirs] - 1.0).max(initial=0.0))
            for key in ("frequency_hz", "damping_ratio")
        }
        out[name] = {"points": float(len(one["frequency_hz"])), **{f"{k}_percent": v for k, v in differ.items()}}
    return out


def cell(one: dict[str, Any], number: int) -> str:
    """Frequency and damping of a point, or dashes where it was not accepted."""
    if number not in one["number"]:
        return f"{'-':>11} {'-':>6}"
    at = one["number"].index(number)
    return f"{one['frequency_hz'][at]:11.5f} {100 * one['damping_ratio'][at]:6.4f}"


def main() -> None:
    """Print the backbones side by side."""
    parser = argparse.ArgumentParser()
    parser.add_argument("plan", nargs="?", default="magnet-beam/backbone")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--lockstep", action="store_true")
    parser.add_argument("--firmware", help="program of the firmware, instead of the emulator")
    wanted = parser.parse_args()
    found = measure(wanted.plan, wanted.lockstep, wanted.firmware)
    differences = compare(found)
    if wanted.json:
        json.dump({"found": found, "differences": differences}, sys.stdout, indent=2)
        return
    print("force N   " + "   ".join(f"{name:>8} Hz      %" for name in found))
    for number, force_n in zip(found["virtual"]["number"], found["virtual"]["force_n"], strict=True):
        print(f"{force_n:7.3f}   " + "   ".join(cell(one, number) for one in found.values()))
    for name, one in found.items():
        told = f"{one['rate_hz']:g} Hz, block {one['block']}, {one['reason']}"
        print(f"\n{name}: {told}; differences {differences[name]}, refused {one['refused']}")
        for key, value in {**one["loop"], **one["counters"]}.items():
            if not isinstance(value, list | dict):
                print(f"    {key} = {value}")


if __name__ == "__main__":
    main()
