"""``rig watch``: a run in a terminal, while it goes on."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rig.live.reader import LiveRun

POLL_S = 0.2  # s between two looks for a run; chosen: shorter than a person notices


def watch_(
    file: Annotated[
        Path | None, typer.Argument(help="Recording of the run to watch; the one begun last if left out.")
    ] = None,
) -> None:
    """Watch a run in a terminal until it is over; wait for one if there is none. Ctrl-C leaves the run alone."""
    from rig.live.place import base_folder
    from rig.monitor.watching import watch
    from rig.system.privileges import lower_priority

    base_folder()  # says what is wrong with it
    lower_priority()
    try:
        with _found(file) as run:
            told = watch(run)
    except KeyboardInterrupt:
        print("stopped watching; the run continues", file=sys.stderr)
        return
    if not told:
        raise typer.Exit(1)


def _found(file: Path | None) -> "LiveRun":
    from rig.live.reader import run_into

    waiting = False
    while (run := run_into(file)) is None:
        if not waiting:
            print(f"no run {'' if file is None else f'into {file} '}is under way; waiting", file=sys.stderr)
            waiting = True
        time.sleep(POLL_S)
    return run
