"""JSON objects as UTF-8 bytes: numpy values welcome, every text comes back as it was."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from rig.errors import RecordingError


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not a JSON value")


def encode(value: Mapping[str, object], *, what: str, indent: int | None = None) -> bytes:
    """JSON text of one object; ``what`` names it in the error.

    Non-finite floats are written as ``NaN`` and ``Infinity``, as Python's ``json`` and most readers take them.

    Raises:
        RecordingError: ``value`` is no mapping or holds something that JSON cannot hold.
    """
    if not isinstance(value, Mapping):
        raise RecordingError(f"{what}: {type(value).__name__} given, a mapping is expected")
    try:
        text = json.dumps(dict(value), default=_plain, ensure_ascii=False, indent=indent)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordingError(f"{what}: cannot be written as JSON ({error})") from error
    # A lone surrogate (from an undecodable file name) has no UTF-8 form; its JSON escape has, and reads back the same.
    return text.encode("utf-8", "backslashreplace")


def decode(text: bytes | str) -> dict[str, Any]:
    """Read the JSON object in ``text``.

    Raises:
        ValueError: it is not JSON, or not an object.
    """
    try:
        value = json.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(value, dict):
        raise ValueError("not a JSON object")
    return value
