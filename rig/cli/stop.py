"""``rig stop``: bring runs that are under way to 0 V, from any terminal of the same user."""

import os
import time
from pathlib import Path
from typing import Annotated

import typer

POLL_S = 0.02  # s between two looks at the runs; chosen: shorter than a person notices


def stop(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Recording of the run to stop. If left out: every run of yours; on a terminal you are asked."
        ),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Stop every run of yours, without a question.")] = False,
    timeout: Annotated[
        float | None,
        typer.Option(metavar="S", help="Longest time to wait for 0 V; the run's ramp and 10 s if left out.", min=0.0),
    ] = None,
) -> None:
    """Ramp runs down and wait until their output is at 0 V; status 1 if that is not known of all. No emergency stop."""
    from rig.cli.which_run import asked_for
    from rig.errors import ConfigurationError, RecordingError
    from rig.live.place import base_folder, runs
    from rig.live.reader import left_behind, run_into
    from rig.monitor.shutdown_monitor import ShutdownMonitor
    from vibrolock.printable import printable

    base_folder()  # says what is wrong with it
    if file is not None and every:
        raise ConfigurationError(f"{file}: given with --all, allowed is one of the two")
    if file is None:
        folders = runs() if every else asked_for(runs())
    else:
        found = run_into(file)
        folders = [] if found is None else [found.folder]
        if found is not None:
            found.close()
    folders = folders or left_behind(file)
    if not folders:
        raise RecordingError("no run is under way" if file is None else f"{file}: no run into this file is under way")
    cause = f"stopped by `rig stop` (process {os.getpid()})"
    left = [ShutdownMonitor(folder, cause, timeout) for folder in folders]
    failed = False
    while left:
        for one in list(left):
            outcome = one.outcome()
            if outcome is not None:
                print(printable(f"{one.name}: {outcome.text}"), flush=True)
                failed = failed or not outcome.at_0_v
                one.close()
                left.remove(one)
        time.sleep(POLL_S)
    if failed:
        raise typer.Exit(1)
