"""Words for what is shown: times, numbers, points, events and shares, as terminal and plain lines print them."""

import math

from rig.live.facts import Line, RunFacts, number_in, text_in
from rig.monitor.shown import Shown
from rig.text.column import Column
from rig.text.console import number
from rig.text.durations import duration
from rig.text.levels import in_shown_unit
from vibrolock.printable import one_line, printable

CLOSE = 0.8
"""Share of a limit from which on it counts as close; chosen."""


def figure(value: float, pattern: str) -> str:
    """Return a number in a format, or a dash if it is not known."""
    return format(value, pattern) if math.isfinite(value) else "-"


def share_word(share: float) -> str:
    """Return how near a limit something is, in a word."""
    if not math.isfinite(share):
        return "-"
    return "OVER" if share >= 1.0 else "close" if share >= CLOSE else "ok"


def state_text(shown: Shown, facts: RunFacts) -> str:
    """Return the present state in one line."""
    now = shown.details
    if now is None:
        return shown.state
    parts = [f"{now.time_s:.1f} s", shown.state]
    if shown.cause:
        parts.append(printable(shown.cause))
    if now.output_off:
        parts.append("output at 0 V")
    elif now.point > 0:
        parts.append(f"point {now.point} of {now.points}")
    parts += [
        " ".join(("level", *_level(now.level, facts))),
        f"{figure(now.frequency_hz, '.4f')} Hz",
        f"phase error {figure(now.phase_error_deg, '.2f')} deg",
        f"{figure(now.force_n, '.4f')} N",
        f"{figure(now.displacement_mm, '.4f')} mm",
        f"{figure(now.voltage_v, '.4f')} V",
    ]
    shares = [one for one in now.shares if math.isfinite(one.share)]
    if shares:
        nearest = max(shares, key=lambda one: one.share)
        parts.append(f"{100.0 * nearest.share:.0f} % of {nearest.name} {nearest.what}")
    return "  ".join([*parts, f"{duration(now.left_s)} left"])


def _level(level: float, facts: RunFacts) -> tuple[str, str]:
    """Return a level and its unit as texts."""
    value, unit = in_shown_unit(level, facts.level_unit)
    return figure(value, ".4g"), unit


def _columns(facts: RunFacts) -> list[Column]:
    return [column for column in facts.columns if column.in_line and not column.optional]


def point_headings(facts: RunFacts) -> list[str]:
    """Return the headings of `point_cells`, with units."""
    quantities = [f"{column.heading} {column.unit}".strip() for column in _columns(facts)]
    return ["point", f"level {in_shown_unit(0.0, facts.level_unit)[1]}", *quantities, "quality"]


def point_cells(point: Line, facts: RunFacts) -> list[str]:
    """Return number, level, the quantities of its kind of campaign, and the quality of a point."""
    cells = [f"{number_in(point, 'number') + 1:.0f}", _level(number_in(point, "level"), facts)[0]]
    for column in _columns(facts):
        value = point.get(column.key)
        if isinstance(value, int | float):
            cells.append(number(value + column.counts_from, column.pattern, column.scale))
        else:
            cells.append("-")
    return [*cells, printable(text_in(point, "quality") or ("good" if point.get("accepted") else "rejected"))]


def point_text(point: Line, facts: RunFacts) -> str:
    """Return a point in one line."""
    number_, level, *values, quality = point_cells(point, facts)
    shown = [
        f"{'' if column.plain else column.heading} {value} {column.unit}".strip()
        for column, value in zip(_columns(facts), values, strict=True)
        if value != "-"
    ]
    reason = text_in(point, "reason")
    ended = f"{quality}: {one_line(reason)}" if reason not in ("", quality) else quality
    return "  ".join([f"point {number_}  {level} {in_shown_unit(0.0, facts.level_unit)[1]}", *shown, ended])


def event_text(line: Line, facts: RunFacts) -> str:
    """Return an event, a remark, or how a part began or ended, in one line; empty for what is told elsewhere."""
    if line["is"] == "end":
        return one_line(f"end: {text_in(line, 'text')}")
    if line["is"] != "event" or line.get("what") == "telemetry":
        return ""
    at = f"{number_in(line, 'sample', 0.0) / facts.sample_rate_hz:.1f} s  "
    if "text" in line:
        return one_line(f"{at}{line['text']}")
    return one_line(f"{at}{line.get('what')}: {line.get('state')}")
