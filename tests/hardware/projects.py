"""Somebody's test project in a folder of its own, with the plug-in installed."""

import contextlib
import importlib.metadata
import json
import os
import subprocess
import sys
import uuid
from pathlib import Path

from tests.docs.pages import ROOT
from tests.forking import FORKED
from tests.waiting import LONG_S

INSTALLED = any(entry.value == "rig.pytest_plugin" for entry in importlib.metadata.entry_points(group="pytest11"))
PLUGIN = [] if INSTALLED else ["-p", "rig.pytest_plugin"]
MARK = "VIBROLOCK_TEST_RUN"
PYTEST = ("-m", "pytest")
FORKED_PYTEST = ("-c", f"{FORKED}import sys, pytest; sys.exit(pytest.main())")
"""The same in a process that has loaded the product."""


def started(folder, *arguments, how=PYTEST):
    """pytest in that folder, running, and the mark that a new interpreter and all its children carry."""
    mark = uuid.uuid4().hex
    command = [sys.executable, *how, "-q", *PLUGIN, "--rig-result", "result.json", *map(str, arguments)]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_ADDOPTS": "", MARK: mark},  # none that this run was given
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    return process, mark


def ended(folder, *arguments):
    """pytest in that folder, at its end: exit status, text, result file, outcome and reason by the name of the test."""
    process, _ = started(folder, *arguments, how=FORKED_PYTEST)
    text, _ = process.communicate(timeout=LONG_S)
    path = folder / "result.json"
    result = json.loads(path.read_text()) if path.exists() else {"tests": []}
    found = {test["test"].rpartition("::")[2]: (test["outcome"], test["reason"]) for test in result["tests"]}
    return process.returncode, text, result, found


def alive(mark):
    """Processes that carry the mark."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
    return found
