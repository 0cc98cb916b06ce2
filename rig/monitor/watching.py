"""A run watched in a terminal until it is over; as plain lines where there is no terminal."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rig.live.facts import Line, text_in
from rig.monitor.shown import shown_frame
from rig.monitor.words import event_text, point_text, state_text
from vibrolock.printable import printable

if TYPE_CHECKING:
    from rig.monitor.replay import ReplayState, View

POLL_S = 0.1
"""Time between two looks at a run that is printed as lines, s; chosen."""
DRAWINGS_PER_S = 5.0
"""Rate at which the terminal is drawn, 1/s; chosen: as quick as numbers can be read."""
JUMPS = 20
"""Jumps of an arrow key that a whole recording takes; chosen."""
DEAD = "its process ended unexpectedly: whether its output is at 0 V is not known, USE THE HARDWARE STOP"
Keys = Callable[[], str]


def watch(view: "View", keys: Keys = lambda: "") -> bool:
    """Show a view until its run is over; return whether it was told how it ended.

    ``keys`` returns the key that was pressed since, if any: they steer a replay (`_steer`), and ``q`` ends it.
    """
    if sys.stdout is not None and sys.stdout.isatty():
        return _drawn(view, keys)
    return _printed(view)


def how_it_ended(lines: Sequence[Line]) -> str | None:
    """Return how the run ended, if that was told and no part was begun since."""
    return printable(text_in(lines[-1], "text")) if lines and lines[-1]["is"] == "end" else None


def _printed(view: "View") -> bool:
    """Print points, events, remarks and ends as they come, and a line for every state that the run comes to."""
    lines: list[Line] = []
    state = ""
    connected = True
    while connected:
        connected = _goes_on(view)  # asked first: what was told last is read afterwards
        new = view.lines(len(lines))
        lines += new
        for line in new:
            if text := point_text(line, view.facts) if line["is"] == "point" else event_text(line, view.facts):
                _print(text)
        shown = shown_frame(view.frame(), view.facts, lines)
        if shown.state != state:
            state = shown.state
            _print(state_text(shown, view.facts))
        if connected:
            time.sleep(POLL_S)
    ended = how_it_ended(lines)
    if ended is None:
        _print(DEAD)
    return ended is not None


def _drawn(view: "View", keys: Keys) -> bool:
    from rich.console import Console
    from rich.live import Live

    from rig.monitor.terminal import draw

    console = Console()
    lines: list[Line] = []
    generation = 0
    with Live(console=console, screen=True, auto_refresh=False) as screen:
        while True:
            connected = view.connected
            if (now := view.generation) != generation:  # a replay has jumped: its lines begin anew
                generation, lines = now, []
            lines += view.lines(len(lines))
            shown = shown_frame(view.frame(), view.facts, lines)
            size = (console.size.width, console.size.height)
            page = draw(shown, view.facts, lines, size=size, connected=connected, replay=_replay(view))
            screen.update(page, refresh=True)
            key = keys()
            if not connected or key == "q":
                break
            _steer(view, key)
            time.sleep(1.0 / DRAWINGS_PER_S)
    ended = how_it_ended(lines)
    if _replay(view) is None:
        _print(f"{view.facts.recording}: {DEAD if ended is None else ended}")
    return ended is not None or _replay(view) is not None


def _replay(view: "View") -> "ReplayState | None":
    return None if view.player is None else view.player.replay_state()


def _goes_on(view: "View") -> bool:
    replay = _replay(view)
    return view.connected if replay is None else replay.time_s < replay.duration_s


def _steer(view: "View", key: str) -> None:
    """Pause or go on with the space bar; jump by a twentieth of a recording with the arrows."""
    player = view.player
    if player is None or not key:
        return
    replay = player.replay_state()
    jump_s = replay.duration_s / JUMPS
    if key == " ":
        (player.pause if replay.playing else player.play)()
    elif key in ("left", "right"):
        player.seek(replay.time_s + (jump_s if key == "right" else -jump_s))


@contextmanager
def keys_of_the_terminal() -> Iterator[Keys]:
    """Yield a function that returns the key pressed since it was last called: a letter, ``left``, ``right``, or nothing."""
    try:
        import select
        import termios
        import tty
    except ImportError:  # Windows
        yield lambda: ""
        return
    if sys.stdin is None or not sys.stdin.isatty():
        yield lambda: ""
        return
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def pressed() -> str:
        import os

        if not select.select([descriptor], [], [], 0.0)[0]:
            return ""
        typed = os.read(descriptor, 16).decode(errors="replace")
        return {"\x1b[D": "left", "\x1b[C": "right"}.get(typed[:3], typed[:1])

    try:
        tty.setcbreak(descriptor)
        yield pressed
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _print(line: str) -> None:
    print(line, flush=True)
