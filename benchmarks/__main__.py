"""All ratios against baselines of the same run, in one table.

    python -m benchmarks [--minutes 1] [--page docs/reference/benchmarks.md]

Times differ from machine to machine and from hour to hour; a ratio to something that ran beside it says more. Every part runs
in a process of its own. ``--page`` puts the table under the version and the machine into a page, in place of one that is
there. The wall-clock loop is measured where ``cyclictest`` is installed and ``--minutes`` is above 0.
"""

import argparse
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

import vibrolock

ROUNDS = 5


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
        yield Ratio(f"Runge-Kutta with 8 sub-steps, {bench}", "fused loop", found["rk4_over_fused"])
        yield Ratio(f"integrator, {bench}", "fused loop", found["share_of_integrator"])
        yield Ratio(f"tick, {bench}", "fused loop", found["share_of_tick"])
        yield Ratio(f"exchange in blocks of 64, {bench}", "fused loop", found["exchange_64_over_fused"])
        if "recorded_us_per_sample" in found:
            fused, whole = found["fused_us_per_sample"], found["recorded_us_per_sample"]
            yield Ratio(f"a whole backbone with journal and file, {bench}", "fused loop", whole / fused)
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
        times: dict[str, list[float]] = {name: [] for name in ("", *asked)}
        for number in range(ROUNDS + 1):
            for name, arguments in asked.items():
                times[name].append(_processor_s(partial(_rig, *arguments)))
            times[""].append(_processor_s(partial(_python, "-c", "import numpy")))
            if number == 0:
                times = {name: [] for name in times}  # the first round compiles and fills caches
        base = statistics.median(times.pop(""))
        for name, values in times.items():
            yield Ratio(name, f"starting Python with numpy ({base:.2f} s)", statistics.median(values) / base)


def pnlss() -> Iterator[Ratio]:
    """An iteration of a nonlinear state-space fit."""
    for threads, sizes in _json("benchmarks.pnlss_iteration", "--json").items():
        for size, found in sizes.items():
            what = f"PNLSS iteration, {size}, {threads}"
            yield Ratio(what, "dsyrk of its Jacobian's size, wall time", found["wall_over_syrk"])
            yield Ratio(f"plain numpy, {size}, {threads}", "PNLSS iteration", found["times_plain_numpy"])


def wall_clock(minutes: float) -> Iterator[Ratio]:
    """Lateness of the loop by the clock."""
    rates = ("2000", "5000")
    for rate, found in _json("benchmarks.wall_clock", "--minutes", str(minutes), "--rates", *rates, "--json").items():
        for name, value in _leaves(found):
            if "over_cyclictest" in name:
                yield Ratio(f"loop by the clock, {rate}, {name}", "cyclictest", value)


def _leaves(found: dict[str, Any], path: str = "") -> Iterator[tuple[str, float]]:
    for key, value in found.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{key} ")
        elif isinstance(value, float):
            yield f"{path}{key}", value


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


def machine() -> str:
    """What the table was measured on."""
    cpu = platform.processor() or platform.machine()
    with_models = Path("/proc/cpuinfo")
    if with_models.exists():
        found = re.search(r"model name\s*: (.*)", with_models.read_text(encoding="utf-8"))
        cpu = found.group(1) if found else cpu
    versions = f"Python {platform.python_version()}, numpy {np.__version__}"
    return f"{cpu}, {os.cpu_count()} processors, {platform.system()}, {versions}"


def table(ratios: list[Ratio]) -> str:
    """Return the table as Markdown, under version, machine and date."""
    head = f"## {vibrolock.__version__}, {machine()}\n\nMeasured {time.strftime('%Y-%m-%d')}.\n\n"
    rows = "".join(f"| {ratio.what} | {ratio.over} | {ratio.value:.3g} |\n" for ratio in ratios)
    return f"{head}| what | over | ratio |\n|---|---|---|\n{rows}"


def put(page: Path, text: str) -> None:
    """Put a table into a page: in place of the one with the same heading, else before the others."""
    heading = text.splitlines()[0]
    head, *sections = re.split(r"^(?=## )", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    kept = [section for section in sections if section.splitlines()[0] != heading]
    page.write_text("\n".join(part.strip() + "\n" for part in (head, text, *kept)), encoding="utf-8")


def main() -> None:
    """Measure, print, and put the table into a page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=0.0, help="minutes of the loop by the clock, at each rate")
    parser.add_argument("--page", type=Path, help="page that gets the table")
    given = parser.parse_args()
    parts: list[Callable[[], Iterator[Ratio]]] = [commands, loop, pnlss]
    if given.minutes > 0.0 and shutil.which("cyclictest"):
        parts.append(partial(wall_clock, given.minutes))
    ratios: list[Ratio] = []
    for part in parts:
        for ratio in part():
            ratios.append(ratio)
            print(f"{ratio.value:9.3g}  {ratio.what}, over {ratio.over}", flush=True)
    text = table(ratios)
    if given.page is not None:
        put(given.page, text)


if __name__ == "__main__":
    main()
