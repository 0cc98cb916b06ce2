"""Commands as they are typed, with what they print kept apart."""

import contextlib
import io
import sys
from dataclasses import dataclass

import pytest

from rig.cli import main


@dataclass(frozen=True)
class Typed:
    """What a command came to."""

    status: int
    out: str
    err: str


def typed(line: str) -> Typed:
    out, err = io.StringIO(), io.StringIO()
    before, sys.argv = sys.argv, ["rig", *line.split()]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stop:
            main()
    finally:
        sys.argv = before
    return Typed(int(stop.value.code or 0), out.getvalue(), err.getvalue())
