"""Replace field names in error messages of the library by options of the command line.

The library speaks to Python users: an error carries the name of a field of a request, and a message names other fields in
backticks, such as `` `band_hz` ``. Each parameter of a command has the name of the field that it fills, with the prefix ``no_``
if it turns the field off, and with the suffix ``_`` if Python already uses the name. Therefore the table from fields to options
is derived from the commands.
"""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer

from rig.cli.group import command_of
from rig.cli.studies import installed_command
from vibrolock.errors import StatedError

if TYPE_CHECKING:
    from typer._click.core import Command

_OTHER_FIELDS = {"largest_range_use": "allow_extrapolation"}
"""Fields of the library whose option turns something on, by the name of the parameter."""


def flags(app: typer.Typer, arguments: Sequence[str] = (), *, studies: bool = True) -> dict[str, str]:
    """Return the option for each field name, of the commands that ``arguments`` name; of all commands without.

    Options of installed ``studies`` are among them if asked for, which imports the studies.
    """
    found: dict[str, str] = {}
    waiting: list[Command] = [command_of(app)]
    while waiting:
        command = installed_command(waiting.pop()) if studies else waiting.pop()
        inner = getattr(command, "commands", {})
        waiting += [inner[name] for name in (inner.keys() & arguments or inner)]
        for parameter in command.params:
            options = [option for option in parameter.opts if option.startswith("--")]
            if options:
                found[parameter.name.removeprefix("no_").rstrip("_")] = options[0]
    return {**found, **{field: found[option] for field, option in _OTHER_FIELDS.items() if option in found}}


def with_flags(error: StatedError, app: typer.Typer, arguments: Sequence[str]) -> str:
    """Return the line of an error, in which an option of the command stands in place of its field; keys of a file stay."""
    own = flags(app, arguments)
    known = {**flags(app, studies=False), **own}
    line = error.line(lambda one: one.field if one.where else own.get(one.field, one.field))
    return re.sub(r"`([a-z_]+)`", lambda field: known.get(field[1], field[0]), line)
