"""What people wait for: commands as whole processes, with processor time, waiting time and memory; and how they grow.

    python -m benchmarks.waits [--rounds 5] [--rehearse] [--growth] [--most-twins 400] [--json]

Everything is measured on the shipped magnet beam, warm, beside starting Python with numpy. ``--rehearse`` adds 200 twins, which
take minutes. ``--growth`` measures rehearsals over their twins, structured fits over the samples and the elements, and
predictions of sweeps over their length, once each, and gives the exponent of the processor time between the largest two.
"""

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import typer

from benchmarks.frame import show

NUMPY = [sys.executable, "-c", "import numpy"]
FIT = "identify structured loud.h5 --modes modes.h5 --rate 400 --outputs drive,acc_magnet --overwrite"
PREPARED = (
    "run magnet-beam/backbone -o backbone.h5",
    "run magnet-beam/multisine-1 -o quiet.h5",
    "identify linear quiet.h5 --count 1 -o modes.h5",
    "run magnet-beam/multisine-2 -o loud.h5",
    "run magnet-beam/exciter -o exciter-run.h5",
    "identify exciter exciter-run.h5 -o exciter.h5",
    "run magnet-beam/sweep-2 -o sweep.h5",
    f"{FIT} --hold-out 8 -o structured.h5",
    "tune --bench magnet-beam -o tuned.toml --rehearse 0",
)
"""Commands that make what the others take."""
COMMANDS = {
    "rig run": "run magnet-beam/backbone -o run.h5 --overwrite",
    "rig plot": "plot backbone.h5 -o run.png --overwrite",
    "rig tune, with its rehearsal": "tune --bench magnet-beam -o again.toml --overwrite",
    "rig identify structured": f"{FIT} --hold-out 8 -o again.h5",
    "rig predict --sweep": "predict structured.h5 --sweep sweep.h5 --exciter exciter.h5 -o swept.h5 --overwrite",
    "rig predict --frequency-response": "predict structured.h5 --frequency-response 0.25 -o responses.h5 --overwrite",
}
REHEARSE = "rehearse magnet-beam/backbone --from tuned.h5 --seed 1 -o rehearsal.h5 --overwrite --draws"
TWINS = (50, 100, 200, 400, 800)
HELD_OUT = {9: 1, 8: 2, 6: 4, 2: 8}
"""Realisations that are held out, and those that are left for the fit."""
LAWS = (
    "polynomial-spring",
    "polynomial-spring --laws polynomial-damper",
    "polynomial-spring --laws polynomial-damper --laws jenkins",
)
SWEEPS = {0.5: "half as long", 0.25: "as shipped", 0.125: "twice as long"}
"""Rates of sweeps, Hz/s."""


class Used(NamedTuple):
    """What a process and those that it started have used."""

    processor_s: float
    wall_s: float
    memory_bytes: float
    """Largest of any of the processes."""


def used(command: list[str], folder: Path) -> Used:
    """Run a command in a folder; raises `subprocess.CalledProcessError` if it fails."""
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, found = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return Used(found.ru_utime + found.ru_stime, wall_s, 1024.0 * found.ru_maxrss)


def rig(arguments: str) -> list[str]:
    """A command of ``rig`` as its own process."""
    return [sys.executable, "-c", "import sys; from rig.cli import main; sys.exit(main())", *arguments.split()]


def medians(commands: dict[str, list[str]], folder: Path, rounds: int) -> dict[str, Used]:
    """Least and median are near each other on a quiet machine; the median of each number counts. Commands run in turn."""
    found: dict[str, list[Used]] = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            found[name].append(used(command, folder))
    return {name: Used(*map(statistics.median, zip(*all_, strict=True))) for name, all_ in found.items()}


def ratios(folder: Path, rounds: int, *, with_rehearsal: bool) -> dict[str, dict[str, float]]:
    """Processor time, wall time and memory of each command over those of starting Python with numpy."""
    commands = {"": NUMPY, **{name: rig(arguments) for name, arguments in COMMANDS.items()}}
    measured = medians(commands, folder, rounds)
    if with_rehearsal:
        measured["rig rehearse, 200 twins"] = used(rig(f"{REHEARSE} 200"), folder)
    base = measured.pop("")
    return {
        name: {
            "processor_s": one.processor_s,
            "wall_s": one.wall_s,
            "memory_mb": 1e-6 * one.memory_bytes,
            "processor_over_numpy": one.processor_s / base.processor_s,
            "memory_over_numpy": one.memory_bytes / base.memory_bytes,
        }
        for name, one in measured.items()
    }


def growth(folder: Path, most_twins: int) -> dict[str, dict[str, float]]:
    """Processor time, s, over size, and the exponent between the largest two sizes."""
    out = {
        "rehearsal over twins": _grown(((float(n), f"{REHEARSE} {n}") for n in TWINS if n <= most_twins), folder),
        "structured fit over realisations": _grown(
            ((float(n), f"{FIT} --hold-out {held} -o grown.h5") for held, n in HELD_OUT.items()), folder
        ),
        "structured fit over elements": _grown(
            ((float(n), f"{FIT} --hold-out 8 --laws {laws} -o grown.h5") for n, laws in enumerate(LAWS, 1)), folder
        ),
    }
    text = Path(__file__).parents[1] / "rig" / "campaigns" / "shipped" / "magnet-beam" / "sweep-2.toml"
    swept = []
    for rate in SWEEPS:
        plan = text.read_text(encoding="utf-8").replace("rate_hz_per_s = 0.25", f"rate_hz_per_s = {rate}")
        (folder / "swept.toml").write_text(plan, encoding="utf-8")
        used(rig(f"run swept.toml -o sweep-{rate}.h5"), folder)
        command = f"predict structured.h5 --sweep sweep-{rate}.h5 --exciter exciter.h5 -o swept.h5 --overwrite"
        swept.append((30.0 / rate, command))
    out["prediction over the length of a sweep, s"] = _grown(swept, folder)
    return out


def _grown(commands: Iterable[tuple[float, str]], folder: Path) -> dict[str, float]:
    times = {size: used(rig(command), folder).processor_s for size, command in commands}
    if len(times) < 2:
        return {f"{size:g}": took for size, took in times.items()}
    (one, before), (two, after) = list(times.items())[-2:]
    return {
        **{f"{size:g}": took for size, took in times.items()},
        "exponent": math.log(after / before) / math.log(two / one),
    }


def main(
    rounds: int = 5,
    rehearse: bool = False,
    growth_too: bool = typer.Option(False, "--growth"),
    most_twins: int = 400,
    as_json: bool = typer.Option(False, "--json"),
) -> None:
    """Measure, and print or write as JSON."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for command in PREPARED:
            used(rig(command), folder)
        found: dict[str, object] = {"commands": ratios(folder, rounds, with_rehearsal=rehearse)}
        if growth_too:
            found["growth"] = growth(folder, most_twins)
    if as_json:
        print(json.dumps(found))
        return
    show(found)


if __name__ == "__main__":
    typer.run(main)
