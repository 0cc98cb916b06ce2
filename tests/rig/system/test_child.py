"""What happens to a child process that reads a file does not happen to its parent."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rig.system.child import ChildFailed, ask_child
from tests.refused import refused
from tests.waiting import LONG_S, wait_until

CHILD = "tests.rig.children"

posix = pytest.mark.skipif(os.name != "posix", reason="limits and signals of POSIX")


def test_a_child_answers_by_what_it_prints():
    assert ask_child(CHILD, "µ-tip", timeout_s=60.0).decode().strip() == "µ-tip"


@posix
def test_a_crash_is_named():
    with refused(ChildFailed, "crashed-sigsegv"):
        ask_child(CHILD, "crash", timeout_s=60.0)


def test_a_child_that_ends_without_an_answer_is_told():
    with refused(ChildFailed, "crashed-status"):
        ask_child(CHILD, "fail", timeout_s=60.0)


def test_a_child_that_hangs_is_ended():
    with refused(ChildFailed, "took-more-than-s"):
        ask_child(CHILD, "hang", timeout_s=1.0)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit address space")
def test_a_child_does_not_get_more_than_its_memory():
    assert ask_child(CHILD, "fill", timeout_s=60.0) == b"no memory\n"


@posix
@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_a_child_ends_with_its_parent(tmp_path, stop):
    told = tmp_path / "pid"
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a shell's background job ignores it
        f"from rig.system.child import ask_child; ask_child({CHILD!r}, 'write-pid-and-hang', {str(told)!r}, timeout_s=600.0)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: told.exists() and told.read_text() != "", "the child")
        child = int(told.read_text())
        parent.send_signal(stop)
        parent.wait(LONG_S)
        wait_until(lambda: not runs(child), "the child's end")
    finally:
        parent.kill()
        parent.wait()


def runs(pid: int) -> bool:
    state = Path(f"/proc/{pid}/stat")
    if state.parent.parent.joinpath("self").exists():
        return state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] != "Z"
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    return True


def test_a_script_without_a_main_guard_reads_an_unverified_file_and_a_mat_file(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import h5py, scipy.io\n"
        "from pathlib import Path\n"
        "from rig.exchange.mat import read_mat\n"
        "from rig.recording.arrays import read_arrays, write_arrays\n"
        "write_arrays('m.h5', 'nonlinear-mode', {'x': [1.0]}, {})\n"
        "h5py.File('m.h5', 'r+').close()\n"
        "scipy.io.savemat('m.mat', {'x': [[1.0, 2.0]]})\n"
        "print(read_arrays('m.h5')[1]['x'], read_mat(Path('m.mat')).values['x'])\n"
    )
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "[1.] [1. 2.]\n"


def test_modules_in_the_working_directory_are_not_imported_by_the_child(tmp_path, monkeypatch):
    (tmp_path / "signal.py").write_text("raise SystemExit(9)\n")
    (tmp_path / "h5py.py").write_text("raise SystemExit(9)\n")
    monkeypatch.chdir(tmp_path)
    assert ask_child(CHILD, "fine", timeout_s=60.0) == b"fine\n"
