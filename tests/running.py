"""How the tests are run: where their files lie, how many workers there are, and which tests begin."""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

MEMORY = Path("/dev/shm")
ENOUGH_BYTES = 6 * 2**30
"""What the files of all tests take, three times over."""

WAITING = tuple(
    f"tests/{place}"
    for place in (
        *("contract/", "firmware/", "hardware/", "reliability/kills/", "reliability/mutations/", "reliability/places/"),
        *("rig/emulator/", "rig/live/", "rig/loop/worker/", "studies/matrix/", "rig/monitor/"),
        *("rig/campaigns/running/test_runs.py", "rig/check/test_on_emulators.py", "rig/cli/test_imports.py"),
        *("rig/cli/test_replay_command.py", "rig/cli/test_stop.py", "rig/recording/test_kill_and_full_disk.py"),
        *(
            "rig/show/test_loop_table.py",
            "rig/wire/serial/",
            "docs/test_driver_template.py",
            "vibrolock/test_compiled.py",
        ),
    )
)
"""Tests that start processes, run by the clock or build programs: they wait for most of their time."""


def keep_bytecode() -> None:
    """Let Python keep the bytecode of tests and product, where the machine is set up to make it anew in every process.

    Else each of some hundred processes compiles a thousand modules, and each worker rewrites the assertions of all tests.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False


def use_memory_for_files() -> None:
    """Keep temporary files in memory where there is enough of it: runs force each recording to the disk several times."""
    if any(os.environ.get(name) for name in ("TMPDIR", "PYTEST_DEBUG_TEMPROOT")):
        return
    if not MEMORY.is_dir() or shutil.disk_usage(MEMORY).free < ENOUGH_BYTES or _available_bytes() < ENOUGH_BYTES:
        return
    folder = MEMORY / f"files-of-tests-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return
    if folder.lstat().st_uid == os.getuid() and not folder.is_symlink():  # nobody else has put it there
        os.environ["TMPDIR"] = str(folder)
        tempfile.tempdir = None  # looked up anew


def _available_bytes() -> int:
    """Memory that can be used without swapping; 0 where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")), 0)


def workers() -> int:
    """How many workers ``-n auto`` starts: more than cores, since tests of processes and clocks wait more than they compute."""
    if given := os.environ.get("PYTEST_XDIST_AUTO_NUM_WORKERS"):
        return int(given)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores + (cores + 1) // 2


def in_order(items: list[pytest.Item]) -> None:
    """Put tests that wait first, which then do so beside others that compute, and those of a class together.

    A random order mixes the classes of a module. What a class makes once would then be made anew at each change of class: a
    process of an emulated device for nearly every test of the contract of drivers. Else the order stays.
    """
    first: dict[str, int] = {}
    for place, item in enumerate(items):
        first.setdefault(_group(item), place)
    items.sort(key=lambda item: (not item.nodeid.startswith(WAITING), first[_group(item)]))


def _group(item: pytest.Item) -> str:
    """The name of a test's class, or of the test itself where it has none."""
    return (item.getparent(pytest.Class) or item).nodeid
