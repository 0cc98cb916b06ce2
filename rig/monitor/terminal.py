"""The terminal view: what is shown of a run, drawn for a terminal of any size. Every colour comes with a word."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.align import Align
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.padding import Padding
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

from rig.live.facts import Line, RunFacts
from rig.monitor.shown import Details, Shown
from rig.monitor.words import event_text, figure, point_cells, point_headings, share_word
from rig.text.durations import duration
from rig.text.levels import in_shown_unit, level_text
from vibrolock.printable import printable

if TYPE_CHECKING:
    from rig.monitor.replay import ReplayState

STALE_S = 0.7
"""Age from which on data counts as stale, s; chosen: with the time between two drawings, it is grey within one second."""
WIDE, LEFT = 120, 62
"""Columns from which on the view has two halves, and columns of the left one; chosen to fit its longest line."""
LAST_LINES = 200
"""Lines that are looked through for events; chosen: more than any terminal has rows."""
STYLES = {
    "not armed": "white on grey30",
    "starting": "white on grey30",
    "searching": "black on orange1",
    "lock lost": "black on orange1",
    "driven": "white on dodger_blue3",
    "locked": "white on dodger_blue3",
    "settling": "white on dodger_blue3",
    "recording": "black on sky_blue1",
    "ramping down": "black on yellow1",
    "tripped": "white on red3",
    "stopped": "black on grey82",
    "finished": "black on grey82",
}
WORDS = {"close": "bold orange1", "OVER": "bold white on red3"}
DEAD = "NOT CONNECTED: USE THE HARDWARE STOP"


def draw(
    shown: Shown,
    facts: RunFacts,
    lines: Sequence[Line],
    *,
    size: tuple[int, int],
    connected: bool = True,
    replay: "ReplayState | None" = None,
) -> RenderableType:
    """Return the view of `rig.monitor.shown.shown_frame` for a terminal of ``size`` (columns, rows)."""
    width, height = size
    over = any(line["is"] == "end" for line in lines[-1:])
    lost = not connected and not over
    now = shown.details
    stale = lost or (connected and now is not None and now.age_s > STALE_S)
    head: list[RenderableType] = [_title(facts, width), _banner(shown, stale=stale, lost=lost, tall=height >= 36)]
    if replay is not None:
        head.append(_replayed(replay, width))
    if now is None:
        return Group(*head, Text("nothing has been published yet", style="grey50"))
    wide = width >= WIDE
    numbers = _numbers(shown.state, now, facts, across=1 if wide else 2)
    rest = height - _rows(head, width)
    if wide:
        right = width - LEFT - 2
        shares = _shares(now, rest - _rows(numbers, LEFT) - 1, bar=8)
        events = _events(lines, facts, max(1, rest // 4), right)
        points = _points(lines, facts, rest - len(events) - 2, right)
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(width=LEFT)
        table.add_column(width=right)
        table.add_row(
            Group(*numbers, *_section("share of limits and ranges", shares)),
            Group(*_section("points", points), *_section("events", events)),
        )
        body: list[RenderableType] = [table]
    else:
        rest -= _rows(numbers, width)
        events = _events(lines, facts, max(1, rest // 8), width)
        shares = _shares(now, max(3, (rest - len(events)) // 2), bar=min(20, max(4, width - 60)))
        points = _points(lines, facts, rest - len(events) - _rows(shares, width), width)
        body = [*numbers, *shares, *points, *events]
    return Group(*head, Greyed(Group(*body)) if stale else Group(*body))


def _rows(what: Sequence[RenderableType], width: int) -> int:
    return len(Console(width=width).render_lines(Group(*what))) if what else 0


class Greyed:
    """Something drawn in grey, whatever its own colours."""

    def __init__(self, what: RenderableType) -> None:
        self._what = what

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw it."""
        for segment in console.render(self._what, options):
            yield segment if segment.control else Segment(segment.text, Style(color="grey50"))


def _title(facts: RunFacts, width: int) -> Text:
    operator = f"operator {facts.operator}" if facts.operator else ""
    told = [facts.purpose or facts.kind, f"bench {facts.bench}", facts.specimen, operator, facts.recording]
    text = Text(printable("  ".join(filter(None, told))), style="grey62", no_wrap=True)
    text.truncate(width, overflow="ellipsis")
    return text


def _banner(shown: Shown, *, stale: bool, lost: bool, tall: bool) -> RenderableType:
    """Return the state as a bar across the terminal, with level and time left."""
    state, now = shown.state, shown.details
    style = STYLES.get(state, "white on grey30")
    words = Text(" ".join(state.upper()), style=f"bold {style}")
    if shown.output_off and state != "not armed":
        words.append("   OUTPUT AT 0 V", style=f"bold {style}")
    elif now is not None and now.points and state not in ("ramping down", "tripped"):
        words.append(f"   point {min(now.point or now.finished + 1, now.points)} of {now.points}")
        words.append(f"   {duration(now.left_s)} left")
    if stale:
        style = "bold black on grey62"
        old = "" if now is None else f", data of {duration(now.age_s)} ago"
        words = Text(f"{DEAD if lost else 'STALE DATA'}{old}   (last: {state})", style=style)
    rows = [Align.center(words, style=style)]
    if shown.cause:
        rows.append(Align.center(Text(printable(shown.cause), style=f"bold {style}"), style=style))
    return Padding(Group(*rows), (1, 0) if tall or not shown.cause else (0, 0), style=style)


def _replayed(replay: "ReplayState", width: int) -> Text:
    at, whole = replay.time_s, replay.duration_s
    bar = max(10, width - 62)
    filled = round(bar * (at / whole if whole > 0.0 else 1.0))
    how = f"at {replay.speed:g} times the clock" if replay.playing else "PAUSED"
    text = f"REPLAY {at:8.1f} of {whole:.1f} s {'━' * filled}{'─' * (bar - filled)} {how}  space ← → q"
    return Text(text, style="bold", no_wrap=True, overflow="ellipsis")


def _numbers(state: str, now: Details, facts: RunFacts, *, across: int) -> list[RenderableType]:
    """Return numbers with their units, so many in a line, and a line on the loop where that is known."""
    level, unit = in_shown_unit(now.level, facts.level_unit)
    to = (
        f", to {level_text(now.target, facts.level_unit)}" if math.isfinite(now.target) and now.guard == "armed" else ""
    )
    good, needed = now.settled or (0, 0)
    shown = state == "settling" and now.settled is not None
    progress = f"of {needed} periods {_bar(good / needed if needed > 0 else 0.0, 4)}"
    cells = [
        ("frequency", figure(now.frequency_hz, ".4f"), "Hz"),
        ("phase error", figure(now.phase_error_deg, ".2f"), "deg"),
        ("force", figure(now.force_n, ".4f"), "N"),
        ("displacement", figure(now.displacement_mm, ".4f"), "mm"),
        ("voltage", figure(now.voltage_v, ".4f"), "V"),
        ("level", figure(level, ".4g"), unit + to),
        ("time", figure(now.time_s, ".1f"), f"s of part {now.part}"),
        ("settled", str(good) if shown else "-", progress if shown else ""),
    ]
    table = Table.grid(expand=True)
    for _ in range(across):
        table.add_column(ratio=1, no_wrap=True)
    texts = [
        Text.assemble((f"{name:<12} ", "grey62"), (f"{value:>8} ", "bold"), what, overflow="ellipsis")
        for name, value, what in cells
    ]
    for first in range(0, len(texts), across):
        table.add_row(*texts[first : first + across])
    told: list[RenderableType] = [table]
    if any(math.isfinite(value) for value in now.late_us) or now.overruns or now.lost:
        p50, p99, p999, most = (figure(value, ".0f") for value in now.late_us)
        text = f"late {p50} / {p99} / {p999} us (50, 99, 99.9 %), {most} us at most; {now.overruns} overruns"
        text += f", {now.lost} samples lost" if now.lost else ""
        told.append(Text(text, style="grey62", no_wrap=True, overflow="ellipsis"))
    return told


def _bar(part: float, length: int) -> str:
    filled = min(length, math.ceil(part * length)) if math.isfinite(part) else 0
    return "█" * filled + "░" * (length - filled)


def _shares(now: Details, most: int, *, bar: int) -> list[RenderableType]:
    """Return a line for each limit and range, those that are used most first, as many as fit."""
    shares = sorted(now.shares, key=lambda one: -one.share if math.isfinite(one.share) else 1.0)
    if most < 1:
        return []
    table = Table.grid(padding=(0, 1))
    for justify in ("left", "left", "right", "left", "right"):
        table.add_column(justify=justify, no_wrap=True)
    for one in shares[:most]:
        part = one.share
        word = share_word(part)
        style = WORDS.get(word, "")
        percent = f"{figure(100.0 * part, '.0f')} %"
        value = f"{figure(one.value, '.3g')} of {one.of:.3g} {one.unit}"
        bar_text = Text(_bar(part, bar), style=style)
        table.add_row(f"{one.name} {one.what}", bar_text, percent, Text(word, style), value)
    return [table]


def _points(lines: Sequence[Line], facts: RunFacts, most: int, width: int) -> list[RenderableType]:
    """Return the table of the last points that fit, with the columns that fit."""
    points = [line for line in lines if line["is"] == "point"]
    if not points or most < 2:
        return []
    rows = [point_cells(point, facts) for point in points[-(most - 1) :]]
    headings = point_headings(facts)
    widths = [max(len(row[n]) for row in [headings, *rows]) for n in range(len(headings))]
    fitting, used = [], widths[-1]
    for n, wide in enumerate(widths[:-1]):
        if used + wide + 2 <= width:
            fitting.append(n)
            used += wide + 2
    fitting.append(len(widths) - 1)
    table = Table.grid(padding=(0, 2, 0, 0))
    for n in fitting:
        table.add_column(justify="left" if n == len(widths) - 1 else "right", no_wrap=True)
    table.add_row(*(Text(headings[n], style="grey62") for n in fitting))
    for row in rows:
        table.add_row(*(row[n] for n in fitting))
    return [table]


def _events(lines: Sequence[Line], facts: RunFacts, most: int, width: int) -> list[RenderableType]:
    told = [text for line in lines[-LAST_LINES:] if (text := event_text(line, facts))]
    out: list[RenderableType] = []
    for text in told[-most:]:
        line = Text(text, style="grey70", no_wrap=True)
        line.truncate(width, overflow="ellipsis")
        out.append(line)
    return out


def _section(heading: str, rows: Sequence[RenderableType]) -> list[RenderableType]:
    return [Text(heading, style="bold"), *rows] if rows else []
