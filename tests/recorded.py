"""Recordings that tests only read: carried out once for a state of the code, and shared by all tests and workers.

A recording is found by its plan, its bench, its seed and a digest of everything that a run depends on: the code of the bench's
floors up to the campaigns, of the libraries below them, and the versions they run with. On a developer's machine they stay in
pytest's cache folder until this digest changes. A test that is about the run itself carries it out with `rig.run`.
"""

import functools
import hashlib
import importlib.metadata
import os
import platform
import shutil
import tomllib
from contextlib import closing
from pathlib import Path
from typing import Any

from rig.api import Run
from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import bench_of, load_plan, plan_from
from rig.campaigns.running.runner import run_plan
from rig.recording.reader import Recording
from tests.sharing import made_once

ROOT = Path(__file__).parents[1]
KEPT = ROOT / ".pytest_cache" / "recordings"
LIBRARIES = ("h5py", "numba", "numpy", "pydantic", "scipy")
MOST_STATES = 3
"""States of the code whose recordings are kept."""
SHORT: dict[str, Any] = {"levels_v": [0.4, 0.8], "record_periods": 8}
"""What makes a backbone short: two points that settle."""


def recorded(plan: Plan | str | Path, bench: Bench | str | None = None, *, seed: int = 0, **changes: Any) -> Path:
    """The recording of a plan, with ``changes`` to its keys, on its own bench or another. It must not be written to."""
    source = "" if isinstance(plan, Plan) else plan
    plan = changed(plan, **changes)
    if bench is None:
        bench = bench_of(plan, source)
    elif isinstance(bench, str):
        bench = load_bench(bench)
    asked = f"{plan.model_dump_json()}\n{bench.model_dump_json()}\n{seed}"
    name = f"{plan.kind}-{hashlib.sha256(asked.encode()).hexdigest()[:24]}"
    return made_once(_state_folder() / name, lambda folder: _make(folder / "run.h5", plan, bench, seed)) / "run.h5"


def recorded_at(path: Path, plan: Plan | str | Path, bench: Bench | str | None = None, *, seed: int = 0) -> Path:
    """A copy of the recording under a name of its own, with which a test may do what it likes."""
    shutil.copyfile(recorded(plan, bench, seed=seed), path)
    return path


def recorded_run(plan: Plan | str | Path, bench: Bench | str | None = None, *, seed: int = 0, **changes: Any) -> Run:
    """The recording as `rig.run` returns it."""
    return Run(Recording(recorded(plan, bench, seed=seed, **changes)))


def changed(plan: Plan | str | Path, **changes: Any) -> Plan:
    """A plan, or the one of this name or file, with other values of some keys; None takes a key out."""
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    if not changes:
        return plan
    table = plan.model_dump(mode="json") | changes
    return plan_from({key: value for key, value in table.items() if value is not None}, "plan of a test")


def _make(path: Path, plan: Plan, bench: Bench, seed: int) -> None:
    with closing(run_plan(plan, bench, path, RunOptions(seed=seed))) as recording:
        end = recording.parts[-1].end
    if end is None or end["reason"] == "stop_requested":  # the tests are being ended
        raise InterruptedError(f"{path}: the run was stopped; its recording is not kept for other tests")
    path.chmod(0o444)


@functools.cache
def _state_folder() -> Path:
    folder = KEPT / state_of_the_code()
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    known = sorted((one for one in KEPT.iterdir() if one.is_dir()), key=lambda one: one.stat().st_mtime)
    for unused in known[:-MOST_STATES]:
        shutil.rmtree(unused, ignore_errors=True)
    return folder


@functools.cache
def state_of_the_code() -> str:
    """A digest of what a recording depends on besides plan, bench and seed."""
    digest = hashlib.sha256()
    for file in sources():
        digest.update(f"{file.relative_to(ROOT).as_posix()}\n".encode())
        digest.update(file.read_bytes())
    versions = [f"{name} {importlib.metadata.version(name)}" for name in LIBRARIES]
    processor = [f"{name}={os.environ.get(name, '')}" for name in ("NUMBA_CPU_NAME", "NUMBA_DISABLE_JIT")]
    digest.update("\n".join([*versions, *processor, platform.python_version(), platform.machine()]).encode())
    return digest.hexdigest()[:24]


def sources() -> list[Path]:
    """The files that a run can depend on: rooms above the campaigns cannot be imported by it, by contract."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    floors = next(one["layers"] for one in contracts if one.get("containers") == ["rig"])
    rooms = [room for floor in floors[floors.index("campaigns") :] for room in floor.split(" | ")]
    libraries = [ROOT / name for name in ("vibrolock", "controller", "simulators", "identification")]
    found = [ROOT / "rig" / f"{room}.py" for room in rooms if (ROOT / "rig" / f"{room}.py").exists()]
    for folder in [*libraries, *(ROOT / "rig" / room for room in rooms)]:
        found += [file for file in folder.rglob("*") if file.suffix in (".py", ".toml")]
    return sorted(found)
