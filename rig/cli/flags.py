"""Replace field names in error messages of the library by options of the command line.

The library speaks to Python users: its messages name fields of a request in backticks, such as `` `band_hz` ``. Each parameter
of a command has the name of the field that it fills, with the prefix ``no_`` if it turns the field off, and with the suffix
``_`` if Python already uses the name. Therefore the table from fields to options is derived from the commands.
"""

import re
from typing import TYPE_CHECKING

import typer
from typer.main import get_command

from rig.cli.studies import installed_command

if TYPE_CHECKING:
    from typer._click.core import Command

_OTHER_FIELDS = {"largest_range_use": "allow_extrapolation"}
"""Fields of the library whose option turns something on, by the name of the parameter."""


def flags(app: typer.Typer) -> dict[str, str]:
    """Return the option for each field name, over all commands."""
    found: dict[str, str] = {}
    waiting: list[Command] = [get_command(app)]
    while waiting:
        command = installed_command(waiting.pop())
        waiting += getattr(command, "commands", {}).values()
        for parameter in command.params:
            options = [option for option in parameter.opts if option.startswith("--")]
            if options:
                found[parameter.name.removeprefix("no_").rstrip("_")] = options[0]
    return {**found, **{field: found[option] for field, option in _OTHER_FIELDS.items() if option in found}}


def with_flags(message: str, app: typer.Typer) -> str:
    """Replace each field in a message by its option."""
    known = flags(app)
    return re.sub(r"`([a-z_]+)`", lambda field: known.get(field[1], field[0]), message)
