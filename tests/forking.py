"""Processes of the product that tests start: forked from one that has loaded its libraries, in place of a new interpreter.

A new interpreter needs most of a second of processor time for numpy, numba and the product before it does anything, and the
tests start some hundreds. `install` lets `subprocess.Popen` hand over what `is_meant` for it to a server of this worker
(`tests.forking_server`), whose child becomes a child of this process: its number, its parent, its streams, its signals and its
status are those of a process that was started. What a new interpreter may differ in, or what is about it, starts one:
`fresh`, another option or environment of Python's or a library's, and any other system than Linux. So does the first process of
each kind in a run of the tests, which is then once what a user starts.
"""

import atexit
import contextlib
import ctypes
import inspect
import os
import pickle
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.sharing import shared_folder

ROOT = Path(__file__).parents[1]
MODULES = tuple(
    place.replace("/", ".")  # as names they would be taken for what all tests depend on (`tests.changed`)
    for place in (
        *("rig/emulator", "rig/loop/worker", "rig/monitor", "rig/conformance/driving", "rig/recording/whole_read"),
        *("rig/monitor/folder_child", "rig/exchange/process"),
        *("tests/rig/emulator/host_process", "tests/rig/emulator/sound_host"),
        *("tests/reliability/kills/scene", "tests/rig/recording/writer_process"),
    )
)
"""What is forked of ``python -m``; so are the modules of `FOLDERS`."""
FOLDERS = tuple(place.replace("/", ".") for place in ("tests/rig/live/", "tests/rig/monitor/"))
FORKED = "# forked from a process that has loaded the product\n"
"""How a program of ``python -c`` begins that is to be forked."""
MAIN = "from rig/cli import main; main()".replace("/", ".")
COMMANDS = (MAIN, f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {MAIN}")
"""Other programs that are."""
PASSED_ON = (
    *("VIBROLOCK_", "XDG_", "PYTEST_", "HOME", "PYTHONPATH", "TMPDIR", "DISPLAY", "DBUS_", "JACK_"),
    *("TERM", "COLUMNS", "LINES"),
)
"""Beginnings of names of the environment that no library reads when it is loaded."""
SUBREAPER = 36
"""PR_SET_CHILD_SUBREAPER of <sys/prctl.h>: orphans among the descendants become children of this process."""
MOST_BYTES = 100_000

_start: Callable[..., None] = subprocess.Popen._execute_child
_server: dict[int, tuple[socket.socket, dict[str, str]]] = {}
"""By this process's number: a forked one has none of its parent's."""
_is_fresh: list[bool] = []
_one_at_a_time = threading.Lock()


def install() -> None:
    """Fork from now on, where this system can."""
    if sys.platform == "linux" and "VIBROLOCK_TESTS_FRESH" not in os.environ:
        subprocess.Popen._execute_child = _execute_child


@contextlib.contextmanager
def fresh() -> Iterator[None]:
    """A context whose processes are new interpreters."""
    _is_fresh.append(True)
    try:
        yield
    finally:
        _is_fresh.pop()


def is_meant(line: object) -> bool:
    """Whether a command is one of Python's that is forked."""
    line = list(line) if isinstance(line, tuple) else line  # asyncio's
    if _is_fresh or not isinstance(line, list) or line[:1] != [sys.executable]:
        return False
    words = line[2:] if line[1:2] == ["-P"] else line[1:]
    if not all(isinstance(word, str) for word in words):
        return False
    option, what = (*words, "", "")[:2]
    if option == "-m":
        return what in MODULES or what.startswith(FOLDERS)
    return option == "-c" and (what.startswith(FORKED) or what in COMMANDS)


def _execute_child(self: Any, *given: Any) -> None:
    told = inspect.signature(_start).bind(self, *given).arguments
    if is_meant(told["args"]) and not _is_first(told["args"]) and _is_ordinary(told) and _fork(self, told):
        return
    _start(self, *given)


def _is_first(line: list[str]) -> bool:
    """Whether no worker of this run has had this module or command before; the tests' own programs have no kind."""
    words = line[2:] if line[1] == "-P" else line[1:]
    if words[0] == "-c" and words[1] not in COMMANDS:
        return False
    kind = words[1] if words[0] == "-m" else f"rig {words[2] if len(words) > 2 else ''}"
    try:
        (shared_folder() / f"started {kind.replace(os.sep, ' ')[:80]}").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _is_ordinary(told: Mapping[str, Any]) -> bool:
    usual = {"executable": None, "preexec_fn": None, "close_fds": True, "shell": False, "restore_signals": True}
    changed = {"gid": None, "gids": None, "uid": None, "umask": -1, "process_group": -1}
    return all(told.get(name, value) == value for name, value in (usual | changed).items())


def _fork(process: Any, told: Mapping[str, Any]) -> bool:
    """Have it forked; False if it must be started, for its environment or size."""
    server, environment = _the_server()
    wanted = dict(os.environ if told["env"] is None else told["env"])
    differing = {name for name in wanted.keys() | environment.keys() if wanted.get(name) != environment.get(name)}
    if any(not name.startswith(PASSED_ON) for name in differing):
        return False
    passed = sorted(told["pass_fds"])
    ours = [told["p2cread"], told["c2pwrite"], told["errwrite"]]
    streams = [number if fd == -1 else fd for number, fd in enumerate(ours)]
    try:
        folder = Path(told["cwd"] or "").absolute()
        order = pickle.dumps((told["args"][1:], wanted, str(folder), told["start_new_session"], [0, 1, 2, *passed]))
    except (OSError, TypeError):
        return False
    if len(order) > MOST_BYTES or not folder.is_dir():
        return False
    with _one_at_a_time, _adopting():
        socket.send_fds(server, [order], [*streams, *passed])
        process.pid = int(server.recv(64))
    process._child_created = True
    process._close_pipe_fds(
        *(told[name] for name in ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite"))
    )
    return True


@contextlib.contextmanager
def _adopting() -> Iterator[None]:
    prctl = ctypes.CDLL(None).prctl
    prctl(SUBREAPER, 1, 0, 0, 0)
    try:
        yield
    finally:
        prctl(SUBREAPER, 0, 0, 0, 0)


def _the_server() -> tuple[socket.socket, dict[str, str]]:
    if os.getpid() not in _server:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        environment = dict(os.environ)
        command = [sys.executable, "-m", "tests.forking_server", str(theirs.fileno())]
        bare = {name: value for name, value in environment.items() if name != "PYTHONPATH"}
        serving = subprocess.Popen(command, pass_fds=[theirs.fileno()], env=bare, stdin=subprocess.DEVNULL, cwd=ROOT)
        theirs.close()
        atexit.register(_end, os.getpid(), ours, serving)
        _server[os.getpid()] = ours, environment
    return _server[os.getpid()]


def _end(owner: int, connection: socket.socket, serving: "subprocess.Popen[bytes]") -> None:
    if os.getpid() == owner:
        connection.close()  # at which it ends
        serving.wait()
