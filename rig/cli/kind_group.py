"""A command with a subcommand for each kind of model, and the same command without a kind."""

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import typer

from rig.cli.group import Group
from rig.cli.options import Json, Output, Overwrite, with_parameters

if TYPE_CHECKING:
    from rig.results.kind import Identification, Prediction

_WITHOUT_KIND = ""
"""Name of the subcommand that is used when no kind is named."""

Value = bool | int | float | str | Path | Sequence[object] | None
"""Value of an option."""


def parameter(name: str, annotation: Any, default: Any = inspect.Parameter.empty) -> inspect.Parameter:
    """Return a parameter that all kinds have."""
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


class KindGroup(Group):
    """Subcommands that are made when they are asked for, from the declarations of the kinds."""

    text: ClassVar[str]
    """What the command does."""
    usage: ClassVar[str]
    """How it is called."""
    after: ClassVar[str]
    """What the help says after the kinds."""
    files: ClassVar[inspect.Parameter]
    """Parameter of the files that are read."""
    kind: ClassVar[tuple[inspect.Parameter, ...]] = ()
    """Parameter of the kind where no subcommand names it."""

    def kinds(self) -> "Mapping[str, Identification] | Mapping[str, Prediction]":
        """Return the kinds by their words."""
        raise NotImplementedError

    def run(self, word: str, output: Path, overwrite: bool, json: bool, values: dict[str, Value]) -> None:
        """Run the command with the values of its other parameters; ``word`` is empty without a kind."""
        raise NotImplementedError

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the words for the kinds."""
        return list(self.kinds())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a kind."""
        from rig.cli.option_parameters import parameters_of

        known = self.kinds()
        if cmd_name != _WITHOUT_KIND and cmd_name not in known:
            return None
        models = [known[cmd_name].options] if cmd_name else [one.options for one in known.values()]

        def function(*, output: Path, overwrite: bool, json: bool, **values: Value) -> None:
            self.run(cmd_name, output, overwrite, json, values)

        parameters = [
            *(self.files, parameter("output", Output), *(() if cmd_name else self.kind), *parameters_of(models)),
            *(parameter("overwrite", Overwrite, False), parameter("json", Json, False)),
        ]
        text = known[cmd_name].text if cmd_name else self.text
        app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
        app.command(cmd_name or self.name, cls=KindCommand)(with_parameters(function, parameters, text))
        return typer.main.get_command(app)

    @property
    def commands(self) -> dict[str, Any]:
        """All subcommands, and the command without a kind."""
        return {word: self.get_command(None, word) for word in (*self.kinds(), _WITHOUT_KIND)}

    @commands.setter
    def commands(self, _: object) -> None:
        """Leave it: the commands are made on use."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the command without a kind if the first word is neither a kind nor a question for help."""
        named = args[:1] and (args[0] in self.kinds() or args[0] in ctx.help_option_names)
        parsed: list[str] = super().parse_args(ctx, args if named else [_WITHOUT_KIND, *args])
        return parsed

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        """Write how the command is called."""
        formatter.write_usage(ctx.command_path, self.usage)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the kinds and what all of them have in common."""
        with formatter.section("Kinds"):
            formatter.write_dl([(word, kind.text) for word, kind in self.kinds().items()])
        formatter.write_paragraph()
        formatter.write_text(self.after)


class KindCommand(typer.core.TyperCommand):
    """A command whose error for an unknown option names those that it has."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments."""
        try:
            parsed: list[str] = super().parse_args(ctx, args)
        except Exception as error:
            if not getattr(error, "possibilities", True) and hasattr(error, "option_name"):
                known = ", ".join(max(one.opts, key=len) for one in self.params if one.param_type_name == "option")
                vars(error).update(
                    message=f"{error.option_name}: does not apply to `{ctx.command_path.strip()}`; allowed are {known}",
                    possibilities=None,
                )
            raise
        return parsed


def kind_app(group: type[KindGroup]) -> typer.Typer:
    """Return the application of such a group."""
    app = typer.Typer(cls=group, help=group.text)
    app.callback()(lambda: None)
    return app
