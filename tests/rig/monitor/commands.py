"""``rig`` as a process of its own, and the address that it prints."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.forking import FORKED
from tests.waiting import LONG_S

CODE = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a shell's background job ignores it
    "from rig.cli import main; main()"
)


def started(*words: str, **options: object) -> "subprocess.Popen[str]":
    """A process with its output to be read."""
    return subprocess.Popen(
        [sys.executable, "-c", FORKED + CODE, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )  # type: ignore[call-overload]


def address_in(line: str) -> str:
    """The address that a line tells."""
    found = re.search(r"https?://\S+\?token=[\w-]+", line)
    assert found is not None, line
    return found[0]


@contextmanager
def monitor(*words: str, **options: object) -> Iterator[tuple["subprocess.Popen[str]", str]]:
    """``rig monitor`` and its address; killed afterwards if it still goes on."""
    with started("monitor", *words, **options) as process:
        assert process.stdout is not None
        try:
            first = process.stdout.readline()
            line = process.stdout.readline() if "fingerprint" in first else first
            yield process, address_in(line)
        finally:
            process.kill()
            process.communicate(timeout=LONG_S)
