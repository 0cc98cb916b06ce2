"""What is refused: the parts of an error, and its sentence by a name in the table of messages."""

import re
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pydantic import ValidationError

from vibrolock.errors import InputError, StatedError

MESSAGES: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("messages.toml").read_text(encoding="utf-8")
)
"""Patterns of the sentences that tests look for, by the error's name and their own."""


@contextmanager
def refused(
    error: type[Exception], says: str | None = None, **parts: object
) -> Iterator[pytest.ExceptionInfo[Exception]]:
    """Expect an error with these parts, whose line ``says`` what the table of messages has under that name.

    A part may be given as a function of the part that returns whether it is right. The parts of a `ValidationError` are those
    of its first fault.
    """
    with pytest.raises(error) as caught:
        yield caught
    stated = _stated(caught.value)
    for name, wanted in parts.items():
        found = getattr(stated, name)
        assert wanted(found) if isinstance(wanted, Callable) else found == wanted, f"{name} = {found!r} of: {stated}"
    if says is not None:
        assert re.search(MESSAGES[error.__name__][says], str(caught.value)), str(caught.value)
    del caught, stated  # a frame of the traceback, this one, would keep what is open there


def _stated(error: Exception) -> Exception:
    """Return the first fault of a validation: as its validator states it, else with what pydantic says of field and value."""
    if not isinstance(error, ValidationError):
        return error
    fault = error.errors()[0]
    path = ".".join(map(str, fault["loc"]))
    if isinstance(stated := fault.get("ctx", {}).get("error"), StatedError):
        return InputError.of(stated, where=path)
    return InputError(fault["msg"], field=path, value=fault["input"])
