"""Commands that the distribution of studies brings. It is looked for when one of them is called, or asked for its options."""

from typing import Any

import typer
from typer.core import TyperCommand

from rig.system.studies import find_study, load_study


class StudyCommand(TyperCommand):
    """A command in the place of the one that the studies bring: it runs that one, or says how to install the studies."""

    @property
    def installed(self) -> TyperCommand:
        """The command that the studies bring; this one if they are not installed."""
        entry = find_study(str(self.name))
        if entry is None:
            return self
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(self.name)(entry.load())
        found = typer.main.get_command(alone)
        assert isinstance(found, TyperCommand)
        return found

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: bool) -> Any:
        """Return the context in which the installed command is run."""
        if self.installed is self:
            return super().make_context(info_name, args, parent, **extra)
        return self.installed.make_context(info_name, args, parent, **extra)


def installed_command(command: Any) -> Any:
    """Return the command that is run in the place of ``command``."""
    return command.installed if isinstance(command, StudyCommand) else command


def reproduce_(context: typer.Context) -> None:
    """Record the paper's campaign on a virtual rig, identify all its models, and hold their predictions against the rig.

    It is a part of the distribution vibrolock-studies: pip install ./studies (in a clone of this repository).
    """
    load_study("reproduce", f"rig {context.info_name}")
