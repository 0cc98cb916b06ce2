"""A forked process is to its parent what one that was started is."""

import os
import signal
import subprocess
import sys

import pytest

from tests.forking import COMMANDS, FORKED, _is_first, fresh, is_meant

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")

SAID = """
import json, os, sys
print(json.dumps({
    "argv": sys.argv, "name": __name__, "folder": os.getcwd(), "parent": os.getppid(), "own": os.getpid(), "path": sys.path,
    "session": os.getsid(0), "told": os.environ.get("VIBROLOCK_TOLD"), "read": sys.stdin.read(),
    "files": len(os.listdir("/proc/self/fd")),
}))
print("an error", file=sys.stderr)
"""

CTRL_C = "import os, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
"""Begins a program that Ctrl-C ends, also where the tests were started in the background, which ignores it."""


def said(code, *arguments, **options):
    command = [sys.executable, "-c", code, *arguments]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )
    out, err = process.communicate("input")
    return process, out, err


@pytest.mark.parametrize("has_session", [False, True])
def test_a_forked_process_has_what_a_started_one_has(tmp_path, has_session):
    options = {"cwd": tmp_path, "env": {**os.environ, "VIBROLOCK_TOLD": "yes"}, "start_new_session": has_session}
    found = []
    for code in (SAID, FORKED + SAID):
        process, out, err = said(code, "one", "two", **options)
        one = eval(out.replace("null", "None"), {})
        assert (one.pop("own"), err, process.returncode) == (process.pid, "an error\n", 0)
        assert one["parent"] == os.getpid()
        assert one.pop("session") == (process.pid if has_session else os.getsid(0))
        found.append(one)
    started, forked = found
    assert forked == started
    assert is_meant([sys.executable, "-c", FORKED + SAID])


def test_a_forked_process_has_the_product_loaded_and_imports_nothing_from_its_parents_folder():
    _, out, _ = said(f"{FORKED}import sys; print('numba' in sys.modules, 'tests.conftest' in sys.modules)")
    assert out == "True False\n"


@pytest.mark.parametrize(
    ("code", "status", "last"),
    [
        ("import sys; sys.exit(7)", 7, ""),
        ("import sys; sys.exit('bad')", 1, "bad"),
        ("raise KeyError('x')", 1, "KeyError: 'x'"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGTERM)", -signal.SIGTERM, ""),
        (f"{CTRL_C}os.kill(os.getpid(), signal.SIGINT); import time; time.sleep(60)", -signal.SIGINT, None),
        ("import atexit; atexit.register(print, 'end')", 0, ""),
        (
            "import threading, time; threading.Thread(target=lambda: (time.sleep(0.05), print('end'))).start()",
            0,
            "",
        ),
    ],
)
def test_it_ends_as_a_started_one_does(code, status, last):
    ends = [said(text + code) for text in ("", FORKED)]
    for process, _, err in ends:
        assert process.returncode == status
        assert last is None or (err.splitlines() or [""])[-1] == last
    assert ends[0][1] == ends[1][1]


def test_descriptors_are_passed_under_their_numbers():
    ours, theirs = os.pipe()
    code = f"{FORKED}import os; os.write({theirs}, b'here')"
    subprocess.run([sys.executable, "-c", code], pass_fds=[theirs], check=True)
    os.close(theirs)
    assert os.read(ours, 99) == b"here"
    os.close(ours)


def test_what_an_interpreter_would_read_starts_one():
    code = f"{FORKED}import sys; print('numba' in sys.modules)"
    for name, value in (("NUMBA_DISABLE_JIT", "1"), ("LC_ALL", "C.UTF-8"), ("PYTHONWARNINGS", "error")):
        _, out, _ = said(code, env={**os.environ, name: value})
        assert out == "False\n", name


def test_the_first_of_a_kind_is_started_as_a_user_starts_it():
    module = "tests.rig.live.of_no_other_test"
    assert [_is_first([sys.executable, "-P", "-m", module]) for _ in range(3)] == [True, False, False]
    assert not _is_first([sys.executable, "-c", FORKED])


def test_what_is_fresh_or_unknown_is_started():
    command = [sys.executable, "-c", COMMANDS[0]]
    assert is_meant(command)
    assert is_meant(tuple(command))  # of asyncio
    with fresh():
        assert not is_meant(command)
    assert not is_meant([sys.executable, "-c", "import rig"])
    assert not is_meant([sys.executable, "-m", "pytest"])
    assert not is_meant(["rig", "run"])
