"""The commands of ``rig`` with their arguments and options, read from the command line's own declaration."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rig.reference.entry import Entry


@dataclass(frozen=True)
class Command:
    """A command as its help shows it."""

    name: str
    """Full name, such as ``rig run`` or ``rig analyse modes``."""
    usage: str
    """How it is called."""
    text: str
    """What it does."""
    arguments: tuple[tuple[str, str], ...]
    """Each argument with its meaning."""
    options: tuple[tuple[str, str], ...]
    """Each option with its meaning, default and range."""

    @property
    def anchor(self) -> str:
        """Where it stands on the page of commands."""
        return self.name.replace(" ", "-")


def commands_of(group: Any, name: str = "rig") -> Iterator[Command]:
    """Yield the commands of a group, and those of the groups in it; ``typer.main.get_command`` returns a group."""
    for word, command in group.commands.items():
        if not word:  # a group without a subcommand named
            continue
        full = f"{name} {word}"
        yield _command(getattr(command, "installed", command), full)  # what the studies bring
        if hasattr(command, "commands"):
            yield from commands_of(command, full)


def _command(command: Any, name: str) -> Command:
    context = command.context_class(command, info_name=name)
    rows = [(parameter.param_type_name, parameter.get_help_record(context)) for parameter in command.params]
    shown = [(kind, (names, " ".join(text.split()))) for kind, (names, text) in (row for row in rows if row[1])]
    return Command(
        name=name,
        usage=" ".join(command.get_usage(context).removeprefix("Usage:").split()),
        text=str(command.help or "").strip(),
        arguments=tuple(row for kind, row in shown if kind == "argument"),
        options=tuple(row for kind, row in shown if kind == "option"),
    )


def command_entries(group: Any) -> Iterator[Entry]:
    """Yield an entry for every command and every option."""
    for command in commands_of(group):
        line = " ".join(command.text.partition("\n\n")[0].split())
        short = command.name.removeprefix("rig ")
        known, address = (command.name, short), f"command-{command.anchor}"
        yield Entry("command", command.name, known, line, address, command.usage)
        for names, text in command.options:
            for option in option_names(names):
                full = f"{command.name} {option}"
                without_kind = f"{command.name.rpartition(' ')[0]} {option}".removeprefix("rig ")
                words = (full, full.removeprefix("rig "), without_kind, option)
                yield Entry("option", full, words, text, f"{command.anchor}{option}")


def option_names(names: str) -> list[str]:
    """Return the long names of an option, from the text that its help begins with."""
    return [word.strip(",") for word in names.split() if word.startswith("--")]
