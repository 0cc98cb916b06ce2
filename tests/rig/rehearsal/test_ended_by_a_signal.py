"""A rehearsal that a signal ends says so, keeps its draws, and leaves no worker."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.rig.rehearsal.plans import SHORT_TEXT
from tests.waiting import LONG_S, wait_until


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGTERM for a group of processes")
def test_sigterm_ends_it_in_a_line_and_leaves_no_worker(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(SHORT_TEXT)
    command = [sys.executable, "-c", "from rig.cli import main; main()", "rehearse", "short.toml", "--exact"]
    command += ["-n", "100", "--jobs", "2", "-o", "r.h5"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        assert running.stderr is not None
        said = next(line for line in running.stderr if " draws," in line)
        os.kill(running.pid, signal.SIGTERM)
        said += running.stderr.read()
        assert running.wait(LONG_S) == 128 + signal.SIGTERM
        wait_until(lambda: not _group_is_alive(running.pid), "end of the workers")
    assert "ended by SIGTERM" in said
    assert (tmp_path / "r.h5.draws").exists()


def _group_is_alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
