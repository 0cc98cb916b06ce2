"""The options of the command line, in the place of the fields that an error of the library names.

The library speaks to Python users: its messages name fields of a request in backticks, such as `` `band_hz` ``. A command's
parameter has the name of the field that it fills (``no_`` before it where it turns it off, ``_`` behind it where Python has
the name already), so the table from fields to options comes from the commands themselves.
"""

import re
from typing import Any

import typer
from typer.main import get_command

__all__ = ["flags", "with_flags"]


def flags(app: typer.Typer) -> dict[str, str]:
    """Option by name of the field that it fills, over all commands."""
    found: dict[str, str] = {}
    waiting: list[Any] = [get_command(app)]
    while waiting:
        command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        for parameter in command.params:
            options = [option for option in parameter.opts if option.startswith("--")]
            if options:
                found[parameter.name.removeprefix("no_").rstrip("_")] = options[0]
    return found


def with_flags(message: str, app: typer.Typer) -> str:
    """A message with the option in the place of each field."""
    known = flags(app)
    return re.sub(r"`([a-z_]+)`", lambda field: known.get(field[1], field[0]), message)
