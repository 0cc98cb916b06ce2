"""The process that `tests.forking` forks from: ``python -m tests.forking_server SOCKET``; it ends with its socket."""

import atexit
import contextlib
import fcntl
import gc
import importlib
import os
import pickle
import runpy
import signal
import socket
import sys
import tempfile
import threading
import traceback
from pathlib import Path
from typing import Any, NoReturn

LOADED = tuple(
    place.replace("/", ".")  # as in `tests.forking`
    for place in (
        *("numpy", "numba", "h5py", "serial", "pydantic", "rig", "rig/cli", "rig/cli/run", "rig/cli/slow_commands"),
        *("rig/emulator/process", "rig/emulator/settings", "rig/loop/worker/process", "rig/campaigns/running/runner"),
        "rig/drivers/wire",
    )
)
RUNS = tuple(place.replace("/", ".") for place in ("rig/campaigns/plans", "rig/campaigns/running/runner"))
HIGH = 200
"""Numbers of descriptors from here on are free."""


def serve(connection: socket.socket) -> None:
    """Fork for every order, and answer with the number of the process."""
    here = sys.path[1:]
    while True:
        order, descriptors, _, _ = socket.recv_fds(connection, 200_000, 64)
        if not order:
            return
        said, saying = os.pipe()
        middle = os.fork()
        if middle == 0:
            middle = os.getpid()
            child = os.fork()
            if child == 0:
                become(*pickle.loads(order), descriptors, middle, here)
            os.write(saying, str(child).encode())
            os._exit(0)
        os.waitpid(middle, 0)  # its child is an orphan from now on, and adopted
        connection.send(os.read(said, 64))
        for number in (said, saying, *descriptors):
            os.close(number)


def become(
    words: list[str],
    environment: dict[str, str],
    folder: str,
    has_session: bool,
    numbers: list[int],
    descriptors: list[int],
    middle: int,
    here: list[str],
) -> NoReturn:
    """Be the process that was ordered, to its end."""
    status = 1
    try:
        while os.getppid() == middle:
            os.sched_yield()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if has_session:
            os.setsid()
        _take(descriptors, numbers)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        is_safe = words[0] == "-P"
        option, what, *arguments = words[1:] if is_safe else words
        given = [str(Path(path).absolute()) for path in environment.get("PYTHONPATH", "").split(os.pathsep) if path]
        first = [] if is_safe else ["" if option == "-c" else folder]
        sys.path[:] = [*first, *dict.fromkeys([*given, *here])]
        sys.orig_argv[1:] = words
        status = _status_of(option, what, arguments)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        os._exit(status & 255)


def _take(descriptors: list[int], numbers: list[int]) -> None:
    """Give the descriptors their numbers, and close all others."""
    high = [fcntl.fcntl(one, fcntl.F_DUPFD_CLOEXEC, HIGH) for one in descriptors]
    for one, number in zip(high, numbers, strict=True):
        os.dup2(one, number, inheritable=True)
    for number in [int(path.name) for path in Path("/proc/self/fd").iterdir()]:
        if number not in numbers:
            with contextlib.suppress(OSError):
                os.close(number)
    for name, number, mode, errors in (("stdin", 0, "r", "strict"), ("stdout", 1, "w", "strict")):
        setattr(sys, name, os.fdopen(number, mode, errors=errors, closefd=False))
    sys.stderr = os.fdopen(2, "w", errors="backslashreplace", buffering=1, closefd=False)
    sys.__stdin__, sys.__stdout__, sys.__stderr__ = sys.stdin, sys.stdout, sys.stderr


def _status_of(option: str, what: str, arguments: list[str]) -> int:
    """Carry out a module or a program, and what an interpreter does at its end; returns the status."""
    sys.argv = ["-c" if option == "-c" else what, *arguments]
    status: Any = 0
    try:
        if option == "-m":
            runpy.run_module(what, run_name="__main__", alter_sys=True)
        else:
            main = type(sys)("__main__")
            sys.modules["__main__"] = main
            exec(compile(what, "<string>", "exec"), main.__dict__)
    except SystemExit as end:
        status = end.code
    except KeyboardInterrupt:
        traceback.print_exc()
        _at_the_end()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:
        traceback.print_exc()
        status = 1
    if isinstance(status, str):
        print(status, file=sys.stderr)
        status = 1
    _at_the_end()
    return 0 if status is None else int(status)


def _at_the_end() -> None:
    threading._shutdown()
    atexit._run_exitfuncs()


def run_once() -> None:
    """Carry out a short plan: machine code is loaded, and what a run imports as it goes on."""
    planning, running = (importlib.import_module(name) for name in RUNS)
    plan = planning.load_plan("magnet-beam/backbone-short")
    with tempfile.TemporaryDirectory() as folder:
        os.environ |= {"VIBROLOCK_LIVE": folder, "XDG_STATE_HOME": folder}
        running.run_plan(plan, planning.bench_of(plan, ""), Path(folder) / "run.h5").close()


def main() -> None:
    """Load, run, then serve."""
    connection = socket.socket(fileno=int(sys.argv[1]))
    for name in LOADED:
        importlib.import_module(name)
    run_once()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: the tests' process ends this one
    gc.collect()
    gc.freeze()
    serve(connection)


if __name__ == "__main__":
    main()
