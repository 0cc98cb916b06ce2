"""Carry out one kill, and say what was lost by it and what it has left."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import rig
from rig.bench import Bench
from rig.emulator.emulated import emulated
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from tests.named_memory import named_memory
from tests.reliability.kills.cases import Case
from tests.reliability.kills.scene import plan
from tests.rig.rigs import bench_with
from tests.waiting import wait_until

ROOT = Path(__file__).parents[3]
MARK = "VIBROLOCK_KILLED_RUN"


@dataclass
class Outcome:
    """What came of one kill."""

    case: Case
    killed: bool
    """Whether the place was reached; a run that ended before it is none of the kills."""
    rows_noted: int
    """Rows whose write had returned."""
    rows_kept: int
    wrong: list[str] = field(default_factory=list)
    """What should not be; empty where all is well."""


def carried_out(case: Case, folder: Path) -> Outcome:
    """Kill a run, read what is left, resume it, look for leftovers."""
    output, witness = folder / "run.h5", folder / "witness"
    shared = named_memory()
    with _bench(case) as bench:
        before = _before(case, bench, output)
        ended = _killed(case, bench, output, witness)
        found = Outcome(case, _reached(case, ended, output), witness.stat().st_size, 0)
        if not found.killed and ended != 0:
            found.wrong.append(f"ended with status {ended}")
        _nothing_runs_on(folder, found)
        _look(case, output, witness, before, found)
        _resume(case, bench, output, before, found)
    left = sorted(path.name for path in folder.iterdir())
    if left != ["run.h5", "witness"]:
        found.wrong.append(f"left behind: {left}")
    if more := named_memory() - shared:
        found.wrong.append(f"left in memory: {sorted(more)}")
    return found


@contextmanager
def _bench(case: Case) -> Iterator[Bench]:
    if case.device in ("serial", "can"):
        with emulated(bench_with(), case.device, seed=1) as bench:
            yield bench
    else:
        yield bench_with()


def _before(case: Case, bench: Bench, output: Path) -> np.ndarray | None:
    """What lies under the name of the output before the run: a recording to be overwritten, or one to be resumed."""
    if case.phase.startswith("overwrite"):
        with rig.run(plan(), output=output, seed=9) as run:
            return run.recording.parts[0].read(0, run.recording.n_rows)
    if case.phase == "resume":
        _killed(case._replace(phase="evaluation", at=1, victim="campaign"), bench, output, output.with_name("first"))
        output.with_name("first").unlink()
        with Recording(output) as recording:
            return recording.parts[0].read(0, recording.n_rows)
    return None


def _killed(case: Case, bench: Bench, output: Path, witness: Path) -> int:
    """Status of the process that was to be killed."""
    asked = {
        "output": str(output),
        "witness": str(witness),
        "phase": case.phase,
        "victim": case.victim,
        "at": case.at,
        "resume": case.phase == "resume",
        "bench": bench.model_dump(mode="json"),
        "realtime": case.device == "real time",
        "seed": 1,
    }
    environment = {**os.environ, MARK: str(output.parent)}
    command = [sys.executable, "-m", "tests.reliability.kills.scene"]
    done = subprocess.run(
        command, input=json.dumps(asked), text=True, cwd=ROOT, env=environment, capture_output=True, check=False
    )
    return done.returncode


def _reached(case: Case, status: int, output: Path) -> bool:
    """Whether the place of the kill was reached; of a loop's process that is told in the recording."""
    if case.victim == "campaign":
        return status == -signal.SIGKILL
    with Recording(output) as recording:
        return "SIGKILL" in str((recording.parts[-1].end or {}).get("text"))


def _nothing_runs_on(folder: Path, found: Outcome) -> None:
    """Every process of the killed run ends by itself."""
    if not Path("/proc/self/environ").exists():
        return
    try:
        wait_until(lambda: not _running(folder), "the processes of a killed run end")
    except AssertionError as error:
        found.wrong.append(str(error))


def _running(folder: Path) -> list[int]:
    mark = f"{MARK}={folder}".encode()
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
        except OSError:
            continue
    return found


def _look(case: Case, output: Path, witness: Path, before: np.ndarray | None, found: Outcome) -> None:
    """Compare what is left with what was noted, row by row."""
    noted = witness.read_bytes()
    if not noted and case.phase != "resume":
        _nothing_recorded(output, before, found)
        return
    with Recording(output) as recording:
        parts = [part.read(0, part.n_rows) for part in recording.parts]
    if case.phase == "resume":
        if before is None or parts[0].tobytes() != before.tobytes():
            found.wrong.append("rows of the first part are lost or changed")
        parts = parts[1:]
    kept = parts[-1].tobytes() if parts else b""
    size = parts[-1].dtype.itemsize if parts else 1
    found.rows_noted, found.rows_kept = len(noted) // size, len(kept) // size
    if not kept.startswith(noted):
        found.wrong.append(f"{found.rows_noted} rows were written, {found.rows_kept} kept, or other ones")


def _nothing_recorded(output: Path, before: np.ndarray | None, found: Outcome) -> None:
    """Killed before the first row: an old recording is there, under its name or, until somebody asks for it, another."""
    aside = output.with_name(output.name + ".vibrolock-before")
    if before is not None and not (output.exists() or aside.exists()):
        found.wrong.append("the recording that was to be overwritten is gone")


def _resume(case: Case, bench: Bench, output: Path, before: np.ndarray | None, found: Outcome) -> None:
    """What is left is finished by the next command; where nothing is left, a run begins anew."""
    left = output.exists() or journal_path(output).exists()
    try:
        tripped = case.victim == "loop"  # a driver that failed
        with (
            rig.resume(output, retry_tripped=tripped)
            if left
            else rig.run(plan(), bench=bench, output=output, seed=1) as run
        ):
            if not run.complete:
                found.wrong.append(f"not complete in the end: {run.recording.parts[-1].end}")
            if case.phase == "overwrite before the start" and before is not None:
                part = run.recording.parts[0]
                if part.read(0, part.n_rows).tobytes() != before.tobytes():
                    found.wrong.append("another recording than the old one was put back")
    except Exception as error:  # whatever it is: it is what this looks for
        found.wrong.append(f"{type(error).__name__}: {error}")
