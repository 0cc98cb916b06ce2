"""Starting the loop process, and talking to it."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
from typing import Any

import rig.errors
from rig.errors import DaqError, RigError
from rig.loop.worker.memory import anonymous_file

WITHOUT_HOST = "the device's own watchdog brings its output to 0 V; where it has none, press the emergency stop"
"""What follows where nothing drives a device any more."""
KILLED = "the loop's process was killed; only the device's watchdog has acted"


def supported() -> bool:
    """Whether this system supports a loop process, which needs inherited descriptors."""
    return os.name == "posix"


class Worker:
    """A loop process.

    The process has its own session, so that a terminal's Ctrl-C and hang-up reach only the campaign. It inherits two pipes and
    the memory. It is a separate program, so that a user's script needs no ``__main__`` guard.
    """

    def __init__(self) -> None:
        orders, self._commands = multiprocessing.Pipe(duplex=False)
        self.facts, said = multiprocessing.Pipe(duplex=False)
        self.memory = anonymous_file()
        passed = (orders.fileno(), said.fileno(), self.memory)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "rig.loop.worker", *map(str, passed)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=passed,
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)},  # noqa: PTH109
            )
        except OSError as error:
            os.close(self.memory)
            raise DaqError(f"the loop's process cannot be started: {error}") from error
        finally:
            orders.close()
            said.close()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def send(self, *command: object) -> None:
        """Send an order; if the process is gone, the next `receive` raises."""
        with contextlib.suppress(BrokenPipeError):
            self._commands.send(command)

    def receive(self, expected: str) -> tuple[Any, ...]:
        """Return the next answer of the process; raise the error that it sent, or `DaqError` if it has ended."""
        try:
            name, *facts = self.facts.recv()
        except (EOFError, OSError):
            raise self.ended() from None
        if name == "failed":
            raise rebuilt(*facts[0])
        DaqError.raise_if(name != expected, f"the loop's process says {name!r} where {expected!r} was expected")
        return tuple(facts)

    def ended(self) -> DaqError:
        """Return the error for a process that has ended."""
        try:
            status = self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            return DaqError("the loop's process is silent, and was not waited for any longer")
        how = signal.Signals(-status).name if status < 0 else f"status {status}"
        return DaqError(f"the loop's process has ended ({how}); {WITHOUT_HOST}")

    def end(self, timeout_s: float) -> str:
        """Ask the process to end, then kill it. Return in one sentence what went wrong; empty if it ended by itself."""
        for action, said in ((self._process.terminate, ""), (self._process.kill, KILLED)):
            action()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout_s)
                return said
        return f"{KILLED}, and still exists as process {self.pid}"

    def close(self, timeout_s: float) -> str:
        """Wait a while for the process to end by itself, then `end` it; return what `end` returns."""
        self._commands.close()
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return self.end(timeout_s)
        else:
            return ""
        finally:
            self.facts.close()
            os.close(self.memory)


def rebuilt(names: tuple[str, ...], message: str) -> RigError:
    """Return an error of the other process, as the most specific class that this process knows."""
    for name in names:
        kind = getattr(rig.errors, name, None)
        if isinstance(kind, type) and issubclass(kind, RigError):
            return kind(message)
    return DaqError(message)


def ask(command: str, *arguments: object) -> Any:
    """Run a loop process for one order, ``probe``, ``round trips`` or ``examination``, and return its answer."""
    worker = Worker()
    try:
        worker.send(command, *arguments)
        return worker.receive(command)[0]
    finally:
        worker.close(2.0)
