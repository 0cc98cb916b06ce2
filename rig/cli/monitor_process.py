"""The page beside a run: a process of its own, started with the run and told of by a line. Nothing of it is imported here."""

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rig.system.child import child_environment
from vibrolock.printable import printable

START_S = 20.0
"""Time in which a page must have said where it is, once the run is over."""


@contextmanager
def monitor_process(wanted: bool) -> Iterator[None]:
    """Show the runs of this process on a page, if ``wanted``; say on standard error where it is. It stays after the run.

    However it goes with the page, the run takes no harm: one line says so.
    """
    if not wanted:
        yield
        return
    try:
        page = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig.monitor", str(os.getpid())],
            stdin=subprocess.PIPE,  # ends with the command, whichever way that ends
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=child_environment(),
            start_new_session=True,  # Ctrl-C is meant for the run
        )
    except OSError as error:
        _say(f"the page cannot be started ({error.strerror})")
        yield
        return
    saying = threading.Thread(target=_say_where, args=(page,), name="page", daemon=True)
    saying.start()
    try:
        yield
    finally:
        saying.join(START_S)
        assert page.stdin is not None
        page.stdin.close()
        page.returncode = 0  # it may stay: nobody waits for it


def _say_where(page: "subprocess.Popen[bytes]") -> None:
    assert page.stdout is not None
    with page.stdout:
        line = page.stdout.readline()
    try:
        told = json.loads(line)
    except ValueError:
        told = {"error": "it has ended at once"}
    _say(f"the page is at {told['address']}" if "address" in told else f"the page cannot be started: {told['error']}")


def _say(text: str) -> None:
    clear = "\r\x1b[2K" if sys.stderr is not None and sys.stderr.isatty() else ""
    with contextlib.suppress(OSError):
        print(f"{clear}note: {printable(text)}", file=sys.stderr, flush=True)
