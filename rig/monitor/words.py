"""Words for what is shown: times, numbers, points, events and shares, as terminal and plain lines print them."""

import math
from collections.abc import Mapping
from typing import Any

from rig.text.console import number
from vibrolock.printable import one_line, printable

CLOSE = 0.8


def figure(value: float, pattern: str) -> str:
    """Return a number in a format, or a dash if it is not known."""
    return format(value, pattern) if math.isfinite(value) else "-"


def duration(seconds: float) -> str:
    """Return a time as people say it: ``12 s``, ``3 min 20 s``, ``2 h 5 min``; a question mark if it is not known."""
    if not math.isfinite(seconds):
        return "? s"
    whole = max(0, round(seconds))
    if whole < 100:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def share_word(share: float) -> str:
    """Return how near a limit something is, in a word."""
    if not math.isfinite(share):
        return "-"
    return "OVER" if share >= 1.0 else "close" if share >= CLOSE else "ok"


def state_text(shown: Mapping[str, Any], facts: Mapping[str, Any]) -> str:
    """Return the present state in one line."""
    if "guard" not in shown:
        return str(shown["state"])
    unit = facts["level_unit"]
    parts = [f"{shown['time_s']:.1f} s", str(shown["state"])]
    if shown["cause"]:
        parts.append(printable(str(shown["cause"])))
    if shown["output_off"]:
        parts.append("output at 0 V")
    elif shown["point"] > 0:
        parts.append(f"point {shown['point']} of {shown['points']}")
    parts += [
        f"level {figure(shown['level'], '.4g')} {unit}",
        f"{figure(shown['frequency_hz'], '.4f')} Hz",
        f"phase error {figure(shown['phase_error_deg'], '.2f')} deg",
        f"{figure(shown['force_n'], '.4f')} N",
        f"{figure(shown['displacement_mm'], '.4f')} mm",
        f"{figure(shown['voltage_v'], '.4f')} V",
    ]
    shares = [one for one in shown["shares"] if math.isfinite(one["share"])]
    if shares:
        nearest = max(shares, key=lambda one: float(one["share"]))
        parts.append(f"{100.0 * nearest['share']:.0f} % of {nearest['name']} {nearest['what']}")
    return "  ".join([*parts, f"{duration(shown['left_s'])} left"])


def _columns(facts: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [column for column in facts["columns"] if column["in_line"] and not column["optional"]]


def point_headings(facts: Mapping[str, Any]) -> list[str]:
    """Return the headings of `point_cells`, with units."""
    columns = _columns(facts)
    return [
        "point",
        f"level {facts['level_unit']}",
        *(f"{c['heading']} {c['unit']}".strip() for c in columns),
        "quality",
    ]


def point_cells(point: Mapping[str, Any], facts: Mapping[str, Any]) -> list[str]:
    """Return number, level, the quantities of its kind of campaign, and the quality of a point."""
    cells = [str(int(point["number"]) + 1), figure(float(point["level"]), ".4g")]
    for column in _columns(facts):
        value = point.get(column["key"])
        plain = isinstance(value, int | float)
        cells.append(number(value + column["counts_from"], column["pattern"], column["scale"]) if plain else "-")
    return [*cells, printable(str(point.get("quality") or ("good" if point.get("accepted") else "rejected")))]


def point_text(point: Mapping[str, Any], facts: Mapping[str, Any]) -> str:
    """Return a point in one line."""
    number_, level, *values, quality = point_cells(point, facts)
    shown = [
        f"{value} {column['unit']}".strip()
        if column["plain"]
        else f"{column['heading']} {value} {column['unit']}".strip()
        for column, value in zip(_columns(facts), values, strict=True)
        if value != "-"
    ]
    reason = str(point.get("reason") or "")
    ended = f"{quality}: {one_line(reason)}" if reason not in ("", quality) else quality
    return "  ".join([f"point {number_}  {level} {facts['level_unit']}", *shown, ended])


def event_text(line: Mapping[str, Any], facts: Mapping[str, Any]) -> str:
    """Return an event, a remark, or how a part began or ended, in one line; empty for what is told elsewhere."""
    rate = facts["sample_rate_hz"]
    if line["is"] == "end":
        return one_line(f"end: {line.get('text', '')}")
    if line["is"] != "event" or line.get("what") == "telemetry":
        return ""
    at = f"{int(line.get('sample', 0)) / rate:.1f} s  "
    if "text" in line:
        return one_line(f"{at}{line['text']}")
    return one_line(f"{at}{line.get('what')}: {line.get('state')}")
