"""A group of commands whose help shows the first paragraph of each command in full."""

from functools import cache
from typing import TYPE_CHECKING

import typer
from typer.core import TyperGroup
from typer.main import get_command

if TYPE_CHECKING:  # where the lowest version of typer that is allowed does not have them
    from typer._click.core import Command, Context
    from typer._click.formatting import HelpFormatter


class Group(TyperGroup):
    """Lists its commands with whole sentences; typer cuts them off where a line ends."""

    def format_commands(self, ctx: "Context", formatter: "HelpFormatter") -> None:
        """Write the list of commands."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, command.get_short_help_str(limit=1000)) for name, command in commands if command]
            )


@cache
def command_of(app: typer.Typer) -> "Command":
    """Return an application as a command. It is made once for a process: that takes a third of what `rig show` does."""
    return get_command(app)
