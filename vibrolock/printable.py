"""Text for one line of a terminal: without characters that move the cursor or change the colour, and of limited length."""

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any
from unicodedata import category

LONGEST_LINE = 800
"""Largest length of a message. A longer one is cut in the middle, as it begins with the field and ends with what is allowed."""
LONGEST_VALUE = 60
"""Largest length of a value inside a message."""


def printable(text: str) -> str:
    """Return the text with control and other unprintable characters replaced by Python's escape sequences."""
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() or category(one) == "Zs" else one.encode("unicode_escape").decode("ascii")
        for one in text
    )


def printable_strings(value: Any) -> Any:
    """Return a JSON value in which every text and every text key is `printable`; line ends are kept."""
    if isinstance(value, str):
        return "\n".join(printable(line) for line in value.split("\n"))
    if isinstance(value, Mapping):
        return {printable_strings(key): printable_strings(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [printable_strings(item) for item in value]
    return value


def one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """Return the text as one printable line of about ``longest`` characters; such a line is returned unchanged."""
    if len(text) > 10 * longest:  # the rest would not be shown, so it should not cost time
        text = _without_middle(text, 8 * longest)
    line = printable(" ".join(text.split()))
    return line if len(line) <= longest + 40 else _without_middle(line, longest)


def error_text(error: BaseException) -> str:
    """Return the message of a library's error without line breaks, or the error's type if it has no message."""
    return " ".join(str(error).split()) or type(error).__name__


def _without_middle(text: str, longest: int) -> str:
    half = longest // 2
    return f"{text[:half]} ...({len(text) - 2 * half} characters)... {text[-half:]}"


def shown(value: Any) -> str:
    """Return a value as shown in a message: its ``repr``, shortened and with its size if it is long."""
    if isinstance(value, str) and len(value) > LONGEST_VALUE:
        return f"{value[: LONGEST_VALUE // 2]!r}... ({len(value)} characters)"
    if isinstance(value, Mapping | list | tuple) and len(value) > LONGEST_VALUE:
        return f"{'a table' if isinstance(value, Mapping) else 'a list'} ({len(value)} items)"
    try:
        text = repr(str(value) if isinstance(value, PurePath) else value)
    except (ValueError, RecursionError) as error:  # an integer of more digits than Python prints; nested too deeply
        return f"a value that cannot be shown ({error})"
    return text if len(text) <= 3 * LONGEST_VALUE else f"{text[: 2 * LONGEST_VALUE]}... ({len(text)} characters)"
