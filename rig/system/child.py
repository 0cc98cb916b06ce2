"""Reading in a child process, so that a crash, a hang or excessive memory does not affect this process.

The child is a separate program, so that a user's script needs no ``__main__`` guard. Its memory and time are limited where the
system supports it (Linux, macOS), and it ends with its parent.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

MEMORY_BYTES = 4 * 2**30
"""Address space of a child."""


class ChildFailed(Exception):  # noqa: N818 (says what happened)
    """A child gave no answer; the message says how it ended, as the end of a sentence."""


def ask_child(module: str, *arguments: str, timeout_s: float) -> bytes:
    """Return the output of ``python -m MODULE ARGUMENTS TIMEOUT_S``; raise `ChildFailed` if it crashes or takes too long."""
    theirs, ours = os.pipe()
    try:
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", module, *arguments, f"{timeout_s:.0f}"],
            stdin=theirs,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=child_environment(),
        )
    except OSError as error:
        os.close(ours)
        raise ChildFailed(f"cannot be started ({error.strerror})") from error
    finally:
        os.close(theirs)
    try:
        answer, _ = child.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise ChildFailed(f"took more than {timeout_s:.0f} s") from None
    finally:
        os.close(ours)
        child.kill()
        child.communicate()
    if child.returncode:
        raise ChildFailed(f"crashed ({_how(child.returncode)})")
    return answer


def child_environment() -> dict[str, str]:
    """Return the environment in which a child imports what this process does, with one thread for linear algebra."""
    paths = [path for path in sys.path if path]
    with contextlib.suppress(FileNotFoundError):  # the working folder was removed
        paths = [path or str(Path.cwd()) for path in sys.path]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "OPENBLAS_NUM_THREADS": "1",
    }  # each thread reserves address space


def _how(status: int) -> str:
    with contextlib.suppress(ValueError):
        return signal.Signals(-status).name
    return f"status {status}"


def confine(cpu_s: float) -> None:
    """Limit memory and time of the child, leave Ctrl-C to the parent, and end with the parent; called by the child."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(ImportError, ValueError, OSError):  # not on Windows; a lower limit may be in force
        import resource

        for what, most in ((resource.RLIMIT_CPU, int(cpu_s) + 1), (resource.RLIMIT_AS, MEMORY_BYTES)):
            resource.setrlimit(what, (most, most))


def _end_with_parent() -> None:
    """End the child when its input ends, because the parent closes the input or has ended; nothing is ever written to it."""
    os.read(0, 1)
    os._exit(1)
