"""A JACK server of a test's own, for the emulated sound card."""

import fcntl
import os
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.running import MEMORY

NAMES = 5
"""Names of servers. JACK counts eight servers on a machine, and one that was killed until another takes its name."""
LONGEST_WAIT_S = 300.0
"""For one of the names, while other tests have them."""


@contextmanager
def own_sound_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Give the processes of this context a server of their own; without JACK it skips, or fails where that must be there."""
    missing = _missing()
    if missing and os.environ.get("VIBROLOCK_SOUND") == "required":
        pytest.fail(missing)
    if missing:
        pytest.skip(missing)
    with _own_name() as name:
        monkeypatch.setenv("JACK_DEFAULT_SERVER", name)
        monkeypatch.setenv("JACK_NO_START_SERVER", "1")
        monkeypatch.setenv("JACK_NO_AUDIO_RESERVATION", "1")
        yield


@contextmanager
def _own_name() -> Iterator[str]:
    """A name that no other test of this machine and user has meanwhile."""
    folder = MEMORY if MEMORY.is_dir() else Path(tempfile.gettempdir())  # the same for all runs of the tests
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        for number in range(NAMES):
            name = f"vibrolock-test-{number}"
            path = folder / f"{name}-{os.getuid()}.lock"
            held = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)  # a folder that others write to
            with os.fdopen(held) as lock, suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                for left in servers(name):  # one that hangs at its end keeps its name
                    with suppress(ProcessLookupError):
                        os.kill(left, signal.SIGKILL)
                yield name
                return
        time.sleep(0.2)
    pytest.fail(f"other tests have all {NAMES} names of sound servers")


def servers(name: str) -> list[int]:
    """Processes of this user that are servers of that name."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            variables = (process / "environ").read_bytes().split(b"\0")
            if (
                process / "comm"
            ).read_text().strip() == "jackd" and f"JACK_DEFAULT_SERVER={name}".encode() in variables:
                found.append(int(process.name))
    return found


def _missing() -> str:
    if not shutil.which("jackd"):
        return "no jackd (Debian: jackd2)"
    try:
        import jack  # noqa: F401
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        return f"the audio packages are not there: {error}"
    return ""
