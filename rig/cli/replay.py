"""``rig replay``: a recording as it was, on the page or in a terminal."""

import sys
from pathlib import Path
from typing import Annotated

import typer

__all__ = ["replay_"]


def replay_(
    file: Annotated[Path, typer.Argument(help="Recording to replay.")],
    speed: Annotated[float, typer.Option(help="How many times as fast as the clock, above 0 and up to 1000.")] = 1.0,
    terminal: Annotated[bool, typer.Option("--terminal", help="In this terminal instead of on a page.")] = False,
    port: Annotated[int, typer.Option(help="Port of the page; 0 for a free one.", min=0, max=65535)] = 0,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = False,
) -> None:
    """Show a recording as it was while it was made, with pause and seeking."""
    from rig.monitor.replay import Replay

    with Replay(file, speed) as view:
        if not terminal:
            from rig.monitor.process import serve

            serve(view, title=f"{file.name} (replay)", port=port, open_page=open_)
            return
        from rig.monitor.watching import keys_of_the_terminal, watch

        try:
            with keys_of_the_terminal() as keys:
                watch(view, keys)
        except KeyboardInterrupt:
            print("replayed no further", file=sys.stderr)
