"""All ratios against baselines of the same run, in one table.

    python -m benchmarks [--minutes 1] [--page docs/reference/benchmarks.md]

Times differ from machine to machine and from hour to hour; a ratio to something that ran beside it says more. Every part runs
in a process of its own. ``--page`` puts the table under the version and the machine into a page, in place of one that is
there. The wall-clock loop is measured where ``cyclictest`` is installed and ``--minutes`` is above 0.
"""

import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer

import vibrolock
from benchmarks.frame import in_turn
from studies.matrix.measuring import machine

ROUNDS = 5
"""Measurements of each command, of which the median counts; chosen."""


class Ratio(NamedTuple):
    """A row of the table."""

    what: str
    over: str
    """The baseline."""
    value: float


def loop() -> Iterator[Ratio]:
    """The compiled loop, and a whole run."""
    measured = _json("benchmarks.loop", "--json")
    for bench in (name for name in measured if name != "starting"):
        found = measured[bench]
        yield Ratio(f"integrator, {bench}", "fused loop", found["share_of_integrator"])
        yield Ratio(f"tick, {bench}", "fused loop", found["share_of_tick"])
        for block in (1, 64):
            name = f"exchange in blocks of {block}, {bench}"
            yield Ratio(name, "fused loop", found[f"exchange_{block}_over_fused"])
        whole = found["recorded_us_per_sample"] / found["fused_us_per_sample"]
        yield Ratio(f"a whole backbone with journal and file, {bench}", "fused loop", whole)
    yield Ratio("real time, magnet-beam", "fused loop", measured["magnet-beam"]["fused_realtime_factor"])


def commands() -> Iterator[Ratio]:
    """Warm commands, in processor time over that of starting Python with numpy."""
    with tempfile.TemporaryDirectory() as folder:
        recording = str(Path(folder) / "run.h5")
        _rig("run", "magnet-beam/backbone", "-o", recording)
        figure = str(Path(folder) / "run.png")
        asked = {
            "rig --help": ("--help",),
            "rig list": ("list",),
            "rig show": ("show", recording),
            "rig plot": ("plot", recording, "-o", figure),
            "rig identify": ("identify", recording, "-o", str(Path(folder) / "model.h5"), "--overwrite"),
            "rig run magnet-beam/backbone": ("run", "magnet-beam/backbone", "-o", recording, "--overwrite"),
        }
        work = {name: partial(_processor_s, partial(_rig, *arguments)) for name, arguments in asked.items()}
        work[""] = partial(_processor_s, partial(_python, "-c", "import numpy"))
        in_turn(work, 1)  # compiles and fills caches
        times = in_turn(work, ROUNDS)
        base = statistics.median(times.pop(""))
        for name, values in times.items():
            yield Ratio(name, f"starting Python with numpy ({base:.2f} s)", statistics.median(values) / base)


def waits() -> Iterator[Ratio]:
    """What people wait for, rehearsal included, with memory."""
    for name, found in _json("benchmarks.waits", "--rehearse", "--json")["commands"].items():
        for what in ("processor", "memory"):
            yield Ratio(f"{name}, {what}", "starting Python with numpy", found[f"{what}_over_numpy"])


def points() -> Iterator[Ratio]:
    """The evaluation of a settled point."""
    for bench, found in _json("benchmarks.points", "--json").items():
        over = "harmonics of its phase times samples"
        yield Ratio(f"evaluation of a point, {bench}", over, found["evaluation_over_product"])


def pnlss() -> Iterator[Ratio]:
    """An iteration of a nonlinear state-space fit."""
    for threads, sizes in _json("benchmarks.pnlss_iteration", "--json").items():
        for size, found in sizes.items():
            what = f"PNLSS iteration, {size}, {threads}"
            yield Ratio(what, "dsyrk of its Jacobian's size, wall time", found["wall_over_syrk"])


def tables() -> Iterator[Ratio]:
    """Reading a large CSV file, as whole processes."""
    found = _json("benchmarks.tables", "--json")
    base = found.pop("numpy.loadtxt")
    for name, one in found.items():
        yield Ratio(f"CSV of 60 MB, {name}", "numpy.loadtxt, processor time", one["processor_s"] / base["processor_s"])
        yield Ratio(f"CSV of 60 MB, {name}", "numpy.loadtxt, memory", one["memory_bytes"] / base["memory_bytes"])


def wall_clock(minutes: float) -> Iterator[Ratio]:
    """Lateness of the loop by the clock."""
    rates = ("--rate", "2000", "--rate", "5000")
    for rate, found in _json("benchmarks.wall_clock", "--minutes", str(minutes), *rates, "--json").items():
        for name, value in found["wake_up_over_cyclictest"].items():
            yield Ratio(f"loop by the clock, {rate}, wake_up_over_cyclictest {name}", "cyclictest", value)


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True)


def _rig(*arguments: str) -> None:
    _python("-c", f"import sys; sys.argv = ['rig', *{list(arguments)!r}]; from rig.cli import main; sys.exit(main())")


def _json(module: str, *arguments: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(_python("-m", module, *arguments).stdout)
    return found


def _processor_s(work: Callable[[], object]) -> float:
    before = os.times()
    work()
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def table(ratios: list[Ratio]) -> str:
    """Return the table as Markdown, under version, machine and date."""
    versions = f"Python {platform.python_version()}, numpy {np.__version__}"
    head = f"## {vibrolock.__version__}, {machine()}, {versions}\n\nMeasured {time.strftime('%Y-%m-%d')}.\n\n"
    rows = "".join(f"| {ratio.what} | {ratio.over} | {ratio.value:.3g} |\n" for ratio in ratios)
    return f"{head}| what | over | ratio |\n|---|---|---|\n{rows}"


def put(page: Path, text: str) -> None:
    """Put a table into a page: in place of the one with the same heading, else before the others."""
    heading = text.splitlines()[0]
    head, *sections = re.split(r"^(?=## )", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    kept = [section for section in sections if section.splitlines()[0] != heading]
    page.write_text("\n".join(part.strip() + "\n" for part in (head, text, *kept)), encoding="utf-8")


def main(minutes: float = 0.0, page: Path | None = None) -> None:
    """Measure all ratios, with ``minutes`` of the loop by the clock at each rate; print them, and put them into a page."""
    parts: list[Callable[[], Iterator[Ratio]]] = [commands, waits, loop, points, pnlss, tables]
    if minutes > 0.0 and shutil.which("cyclictest"):
        parts.append(partial(wall_clock, minutes))
    ratios: list[Ratio] = []
    for part in parts:
        for ratio in part():
            ratios.append(ratio)
            print(f"{ratio.value:9.3g}  {ratio.what}, over {ratio.over}", flush=True)
    if page is not None:
        put(page, table(ratios))


if __name__ == "__main__":
    typer.run(main)
