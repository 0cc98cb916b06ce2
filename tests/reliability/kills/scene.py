"""The process that is killed: a run that notes every row whose write has returned, up to the place where it is to die.

``python -m tests.reliability.kills.scene`` with a request as JSON on standard input.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import rig
import rig.campaigns.backbone.points as backbone
import rig.campaigns.running.runner as runner
import rig.recording.conversion as store
from rig.bench import Bench
from rig.campaigns.running.output_file import forget_before
from rig.loop.worker.session import WorkerSession
from rig.recording.journal import JournalWriter
from tests.rig.campaigns.running.test_runs import plan_with


def plan() -> Any:
    """Two short points."""
    return plan_with(levels_v=(0.4, 0.6), record_periods=10)


class Killer:
    """Kills at the place of a case, and notes before what was written."""

    def __init__(self, phase: str, victim: str, at: int, witness: Path) -> None:
        self.phase, self.victim, self.left = phase, victim, at
        self.pid = os.getpid()
        self.witness = os.open(witness, os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def here(self, *phases: str) -> None:
        """Kill, where one of these phases is meant and its place has come."""
        if self.phase not in phases:
            return
        if self.left > 0:
            self.left -= 1
        else:
            os.kill(self.pid, signal.SIGKILL)

    def before(self, function: Callable[..., Any], *phases: str) -> Callable[..., Any]:
        """A function that may be killed before it is called."""

        def called(*arguments: Any, **options: Any) -> Any:
            self.here(*phases)
            return function(*arguments, **options)

        return called

    def after(self, function: Callable[..., Any], *phases: str) -> Callable[..., Any]:
        """A function that may be killed once it has returned."""

        def called(*arguments: Any, **options: Any) -> Any:
            found = function(*arguments, **options)
            self.here(*phases)
            return found

        return called

    def noting(self, real: Callable[..., None]) -> Callable[..., None]:
        """The writing of rows, with a note of those whose write has returned."""

        def rows(writer: JournalWriter, chunk: np.ndarray) -> None:
            self.here("before the first row")
            real(writer, chunk)
            os.write(self.witness, np.ascontiguousarray(chunk, writer.header.row_dtype).tobytes())
            self.here("loop", "overwrite in the loop", "resume")

        return rows


def set_up(killer: Killer) -> None:
    """Put the killer in its places."""
    JournalWriter.rows = killer.noting(JournalWriter.rows)  # type: ignore[method-assign]
    runner._facts = killer.before(runner._facts, "opening")
    runner.JournalWriter.create = killer.after(JournalWriter.create, "overwrite before the start")  # type: ignore[method-assign]
    kind = backbone.BACKBONE
    backbone.BACKBONE = replace(kind, measure=killer.before(kind.measure, "evaluation"))
    real = store.write_recording

    def write_recording(file: Any, header: Any, parts: Any, check: Callable[[], None], *rest: Any) -> None:
        real(file, header, parts, killer.after(check, "conversion"), *rest)

    store.write_recording = write_recording
    runner.forget_before = killer.before(forget_before, "file in place")
    if killer.victim == "loop":
        entered = WorkerSession.__enter__

        def enter(session: WorkerSession) -> WorkerSession:
            found = entered(session)
            killer.pid = session.pid
            return found

        WorkerSession.__enter__ = enter  # type: ignore[method-assign]


def main() -> None:
    """Carry out the request."""
    asked = json.load(sys.stdin)
    output = Path(asked["output"])
    set_up(Killer(asked["phase"], asked["victim"], asked["at"], Path(asked["witness"])))
    if asked["resume"]:
        rig.resume(output, realtime=asked["realtime"]).close()
        return
    bench = Bench.model_validate(asked["bench"])
    overwrite = asked["phase"].startswith("overwrite")
    rig.run(
        plan(), bench=bench, output=output, seed=asked["seed"], realtime=asked["realtime"], overwrite=overwrite
    ).close()


if __name__ == "__main__":
    main()
