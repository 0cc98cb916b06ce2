"""The question which of several runs is to be stopped. Unanswered, or without a terminal, it is all of them."""

import os
import select
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rig.cli.run_options import on_a_terminal

ANSWER_S = 5.0
"""Time for an answer, s; chosen: to read two lines. After it all runs are stopped, for a shaker must not stay driven because a
question was not read."""


def asked_for(folders: Sequence[Path]) -> list[Path]:
    """Return the folders of the runs to stop: all without a terminal, or with fewer than two; otherwise those chosen there."""
    if len(folders) < 2 or not on_a_terminal() or sys.platform == "win32":  # no input with a time limit on Windows
        return list(folders)
    _say(f"{len(folders)} runs are under way:")
    for number, folder in enumerate(folders, 1):
        _say(f"  {number}  {_facts(folder)}")
    _say(f"Which one? Its number, or Enter for all; without an answer, all are stopped in {ANSWER_S:.0f} s: ", end="")
    until_s = time.monotonic() + ANSWER_S
    while (answer := _line(until_s)) is not None:
        if answer.isdecimal() and 1 <= int(answer) <= len(folders):
            return [folders[int(answer) - 1]]
        if answer in ("", "all"):
            return list(folders)
        _say(f"{answer!r} is none of 1 to {len(folders)}; which one? ", end="")
    _say("\nno answer: all are stopped")
    return list(folders)


def _facts(folder: Path) -> str:
    from rig.errors import RecordingError
    from rig.live.reader import LiveRun

    with suppress(RecordingError), LiveRun(folder) as run:
        facts = run.facts
        by = f", by {facts.operator}" if facts.operator else ""
        return f"{facts.recording} (process {facts.process}): {facts.kind} on {facts.bench}, since {facts.started}{by}"
    return f"process {folder.name.partition('-')[0]}"


def _say(line: str, end: str = "\n") -> None:
    from vibrolock.printable import printable

    with suppress(OSError):
        print("\n" * line.startswith("\n") + printable(line.lstrip("\n")), end=end, file=sys.stderr, flush=True)


def _line(until_s: float) -> str | None:
    """Return a line that is typed before this time of the monotonic clock; None if none is, or the terminal has gone."""
    descriptor = sys.stdin.fileno()
    try:
        ready, _, _ = select.select([descriptor], [], [], max(0.0, until_s - time.monotonic()))
        content = os.read(descriptor, 1024) if ready else b""
    except OSError:
        return None
    return content.decode(errors="replace").strip() if content else None
