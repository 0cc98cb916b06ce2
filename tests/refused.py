"""What is refused: the parts of an error, and its sentence by a name in the table of messages."""

import re
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

MESSAGES: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("messages.toml").read_text(encoding="utf-8")
)
"""Patterns of the sentences that tests look for, by the error's name and their own."""


@contextmanager
def refused(
    error: type[Exception], says: str | None = None, **parts: object
) -> Iterator[pytest.ExceptionInfo[Exception]]:
    """Expect an error with these parts, whose line ``says`` what the table of messages has under that name.

    A part may be given as a function of the part that returns whether it is right.
    """
    with pytest.raises(error) as caught:
        yield caught
    for name, wanted in parts.items():
        found = getattr(caught.value, name)
        assert wanted(found) if isinstance(wanted, Callable) else found == wanted, (
            f"{name} = {found!r} of: {caught.value}"
        )
    if says is not None:
        assert re.search(MESSAGES[error.__name__][says], str(caught.value)), str(caught.value)
