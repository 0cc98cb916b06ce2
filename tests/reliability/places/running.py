"""The command in a process of its own, and what every run must leave, whatever happened to it."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from rig.errors import RigError
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from tests.forking import FORKED

ROOT = Path(__file__).parents[3]
PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.6]
record_periods = 10

[controller]
detector = "two-phase"
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""
_MAIN = "from rig.cli import main; main()"


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    output: str
    complaint: str


def write_plan(folder: Path) -> Path:
    """A plan of two short points."""
    path = folder / "plan.toml"
    path.write_text(PLAN)
    return path


def command(*arguments: str | Path, before: str = "") -> list[str]:
    """The command line of ``rig``, with some Python done ``before`` it."""
    return [sys.executable, "-c", f"{FORKED}{before}\n{_MAIN}", *map(str, arguments)]


def run_command(*arguments: str | Path, before: str = "", cwd: Path | None = None, **environment: str) -> Ended:
    """Run the command to its end."""
    surroundings = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(
        command(*arguments, before=before),
        cwd=cwd,
        env=surroundings,
        capture_output=True,
        check=False,
        errors="replace",
        text=True,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def objections(ended: Ended, output: Path, *, succeeds: bool) -> list[str]:
    """What is wrong with how a run ended and with what it left."""
    wrong = []
    if (ended.status == 0) is not succeeds:
        wrong.append(f"status {ended.status}: {ended.complaint[-300:]}")
    if "Traceback" in ended.complaint or "unexpected" in ended.complaint:
        wrong.append(f"no clear line: {ended.complaint[-300:]}")
    last = ended.complaint.strip().splitlines()[-1:] or [""]
    if not succeeds and not (last[0].startswith("rig: ") or ended.output):
        wrong.append(f"nothing said: {ended.complaint[-300:]!r}")
    if output.parent.is_dir():
        wrong += [f"left behind: {path.name}" for path in output.parent.glob("*.vibrolock-part")]
    if output.exists() or journal_path(output).exists():
        try:
            with Recording(output) as recording:
                if succeeds and not recording.complete:
                    wrong.append("the recording is not complete")
        except RigError as error:
            wrong.append(f"what is left cannot be read: {error}")
    elif succeeds:
        wrong.append("there is no recording")
    return wrong
