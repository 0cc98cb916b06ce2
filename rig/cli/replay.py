"""``rig replay``: a recording as it was, on the page or in a terminal."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.monitor import of_a_page
from rig.cli.run_options import with_options

if TYPE_CHECKING:
    from rig.monitor.process import Serving


@with_options(of_a_page, later=True)  # a terminal view does without the page's libraries
def replay_(
    *,
    file: Annotated[Path, typer.Argument(help="Recording to replay.")],
    speed: Annotated[float, typer.Option(help="How many times as fast as the clock, above 0 and up to 1000.")] = 1.0,
    terminal: Annotated[bool, typer.Option("--terminal", help="In this terminal instead of on a page.")] = False,
    options: "Callable[[], Serving]",
) -> None:
    """Show a recording as it was while it was made, with pause and seeking."""
    from rig.monitor.replay import Replay

    with Replay(file, speed) as view:
        if not terminal:
            from rig.monitor.process import serve

            serve(view, options())
            return
        from rig.monitor.watching import keys_of_the_terminal, watch

        try:
            with keys_of_the_terminal() as keys:
                watch(view, keys)
        except KeyboardInterrupt:
            print("replayed no further", file=sys.stderr)
