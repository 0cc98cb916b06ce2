"""A backbone by the clock over emulated devices, run after run: ``python -m benchmarks.repeated_attempts [--runs 2]``.

The shipped plan of the magnet beam runs unchanged on an emulated serial device and on an emulated CAN FD device (``--wire``
also takes ``classical``), each at wall-clock pace with the loop in a process of its own, or in ``--lockstep``; one after the
other, or both at once (``--together``), beside so many processes that compute (``--beside``). ``--firmware`` is run in place
of the emulator. Of each run: points accepted, attempts that were refused, outputs continued and held, samples lost, errors of
frequency and damping against harmonic balance at the voltage of each point, and what loop and wire say of themselves.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import typer

import rig
from benchmarks.frame import show
from benchmarks.outcomes import PLAN, outcome
from rig.bench import load_bench
from rig.emulator.emulated import emulated

WIRES: dict[str, dict[str, Any]] = {
    "serial": {"wire": "serial"},
    "can": {"wire": "can"},
    "classical": {"wire": "can", "fd": False},
}
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


def run_once(block: int, seed: int, settings: dict[str, Any]) -> dict[str, Any]:
    """One run over an emulated device; its outcome and length, and the numbers that loop and wire tell."""
    began = time.monotonic()
    bench = load_bench("magnet-beam").model_copy(update={"block": block})
    with emulated(bench, **settings) as reached, rig.run(PLAN, bench=reached, seed=seed) as run:
        part = run.recording.parts[-1]
        told = {**(part.end or {}).get("loop", {}), **(part.end or {}).get("counters", {})}
        numbers = {name: value for name, value in told.items() if not isinstance(value, list | dict)}
        lead = part.information["about"]["lead_samples"]
        return {**outcome(run), "lead": lead, "seconds": time.monotonic() - began, "told": numbers}


def main(
    runs: int = 2,
    wire: list[str] | None = None,
    block: int = 10,
    queue: int | None = None,
    together: bool = False,
    beside: int = 0,
    lockstep: bool = False,
    firmware: Path | None = None,
    json: bool = False,
) -> None:
    """Carry out so many ``runs`` over each wire; ``queue`` is in blocks, by default the driver's."""
    options = {} if queue is None else {"queue_blocks": queue}
    further = {"lockstep": lockstep, "options": options, "firmware": firmware}
    wires = {name: {**WIRES[name], **further} for name in wire or ("serial", "can")}
    found = {}
    workers = ProcessPoolExecutor(len(wires) if together else 1, get_context("spawn"))
    with busy(beside), workers:
        for number in range(runs):
            asked = {name: workers.submit(run_once, block, number, settings) for name, settings in wires.items()}
            for name, run in asked.items():
                found[f"run {number + 1}, {name}"] = run.result()
    show(found, json)


if __name__ == "__main__":
    typer.run(main)
