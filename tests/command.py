"""The command ``rig`` as it is typed, run in this process."""

import io
import shlex
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple, Self
from unittest import mock

import pytest

from rig.cli import main
from tests.waiting import LONG_S


class Ended(NamedTuple):
    """What a command came to."""

    status: int
    out: str
    err: str

    def succeeded(self) -> Self:
        """Itself; the test fails where the command has failed."""
        assert self.status == 0, self.err
        return self


def run_command(*words: object) -> Ended:
    """Run a command in the present folder: its words, or one line that is split as a shell does."""
    arguments = shlex.split(words[0]) if len(words) == 1 and isinstance(words[0], str) else map(str, words)
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n") for _ in range(2))  # as a pipe: no terminal
    with (
        mock.patch.object(sys, "argv", ["rig", *arguments]),
        redirect_stdout(out),
        redirect_stderr(err),
        signals_as_they_were(),
        mock.patch.multiple("rig.show.waiting", FIRST_S=LONG_S, FURTHER_S=LONG_S),  # what is said is no matter of speed
        pytest.raises(SystemExit) as ended,
    ):
        main()
    for stream in (out, err):
        stream.seek(0)
    return Ended(int(ended.value.code or 0), out.read(), err.read())


@contextmanager
def signals_as_they_were() -> Iterator[None]:
    """Undo what a command does to signals: once a run is over, it ignores them."""
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ended]:
    """`run_command` in the folder of the test, unless the test goes to another one."""
    monkeypatch.chdir(tmp_path)
    return run_command
