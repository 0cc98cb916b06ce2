"""A command with a subcommand for each kind of model, and the same command without a kind."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import typer

from rig.cli.group import Group

_WITHOUT_KIND = ""
"""Name of the subcommand that is used when no kind is named."""


class KindGroup(Group):
    """Subcommands that are made when they are asked for, from the declarations of the kinds."""

    def words(self) -> Mapping[str, str]:
        """Return the words for the kinds, each with a sentence for the help."""
        raise NotImplementedError

    def function(self, word: str) -> Callable[..., None]:
        """Return the function of a kind; of the command without a kind if the word is empty."""
        raise NotImplementedError

    after: ClassVar[str] = ""
    """What the help says after the kinds."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the words for the kinds."""
        return list(self.words())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a kind."""
        if cmd_name != _WITHOUT_KIND and cmd_name not in self.words():
            return None
        app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
        app.command(cmd_name or self.name, cls=KindCommand)(self.function(cmd_name))
        return typer.main.get_command(app)

    @property
    def commands(self) -> dict[str, Any]:
        """All subcommands, and the command without a kind."""
        return {word: self.get_command(None, word) for word in (*self.words(), _WITHOUT_KIND)}

    @commands.setter
    def commands(self, _: object) -> None:
        """Leave it: the commands are made on use."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the command without a kind if the first word is neither a kind nor a question for help."""
        named = args[:1] and (args[0] in self.words() or args[0] in ctx.help_option_names)
        parsed: list[str] = super().parse_args(ctx, args if named else [_WITHOUT_KIND, *args])
        return parsed

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        """Write how the command is called."""
        formatter.write_usage(ctx.command_path, "[KIND] FILE... -o OUTPUT [OPTIONS]")

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the kinds and what all of them have in common."""
        with formatter.section("Kinds"):
            formatter.write_dl(list(self.words().items()))
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
                    message=f"{error.option_name}: means nothing to `{ctx.command_path.strip()}`; allowed are {known}",
                    possibilities=None,
                )
            raise
        return parsed


def with_parameters(run: Callable[[dict[str, Any]], None], parameters: Sequence[inspect.Parameter], text: str) -> Any:
    """Return a function of some parameters, with a text for its help, that passes their values on by name."""

    def function(**values: Any) -> None:
        run(values)

    function.__doc__ = text
    function.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    function.__annotations__ = {one.name: one.annotation for one in parameters}
    return function


def parameter(name: str, annotation: Any, default: Any = inspect.Parameter.empty) -> inspect.Parameter:
    """Return a parameter that all kinds have."""
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
