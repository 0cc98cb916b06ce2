"""Tables as TOML, also such as no model allows, so that a spoilt table goes the way of a file."""

import json
import math
from collections.abc import Mapping
from typing import Any


def toml_of(table: Mapping[str, Any]) -> str:
    """One key a line, tables inside written in the line."""
    return "".join(f"{_text(key)} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_text(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    return str(value) if isinstance(value, int) else _text(str(value))


def _text(text: str) -> str:
    r"""A quoted text; control characters stand as ``\uXXXX``, as TOML has it."""
    return (
        json.dumps(text, ensure_ascii=True).replace("\x7f", "\\u007f")
        if _plain(text)
        else json.dumps(text, ensure_ascii=False)
    )


def _plain(text: str) -> bool:
    return all(ord(one) < 0x10000 and not 0xD800 <= ord(one) <= 0xDFFF for one in text)
