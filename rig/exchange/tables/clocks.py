"""Times of day in tables, ``10:05:00.125`` or ``2026-03-01 10:05:00.125``, as seconds with the digits that they have."""

import re
from datetime import date

_CLOCKS = {
    decimal: re.compile(
        r"(?<![\d:])(?:(\d{4})-(\d\d)-(\d\d)[T ])?"
        rf"(?:(\d{{1,2}}):([0-5]\d):([0-5]\d)|(\d{{1,3}}):([0-5]\d)(?=[{decimal}]\d))([{decimal}]\d+)?Z?(?![\d:])"
    )
    for decimal in ".,"
}
"""Hours, minutes and seconds, with or without a date of ISO 8601; or minutes and seconds with a fraction; by decimal sign."""
_EPOCH = date(1970, 1, 1).toordinal()


def is_clock(cell: str) -> bool:
    """Return whether a cell is a time of day."""
    return any(clock.fullmatch(cell.strip().strip('"')) for clock in _CLOCKS.values())


def in_seconds(text: str, decimal: str) -> str:
    """Return a text with all times of day in seconds: since midnight, or since 1970 where they have a date."""
    return _CLOCKS[decimal].sub(lambda found: _seconds(found, decimal), text)


def _seconds(found: re.Match[str], decimal: str) -> str:
    year, month, day, hours, minutes, seconds, only_minutes, with_seconds, fraction = found.groups()
    try:
        days = date(int(year), int(month), int(day)).toordinal() - _EPOCH if year else 0
    except ValueError:
        return found[0]  # no day of any month
    whole = (
        int(hours) * 3600 + int(minutes) * 60 + int(seconds) if hours else int(only_minutes) * 60 + int(with_seconds)
    )
    return f"{days * 86400 + whole}{decimal}{fraction[1:] if fraction else '0'}"
