"""Processes that publish and read, in a folder of the test's own."""

import os
import subprocess
import sys

import pytest

from tests.docs.pages import ROOT


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    """The folder in which the runs of a test are found."""
    monkeypatch.setenv("VIBROLOCK_LIVE", str(tmp_path / "live"))
    return (
        tmp_path
        / "live"
        / f"vibrolock-{os.getuid() if sys.platform != 'win32' else os.environ.get('USERNAME', 'user')}"
    )


@pytest.fixture
def started():
    """Start a module of the tests as a process; ended with the test."""
    children = []

    def start(module, *arguments):
        command = [sys.executable, "-m", module, *map(str, arguments)]
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path}
        )
        children.append(child)
        return child

    yield start
    for child in children:
        child.kill()
        child.communicate()
