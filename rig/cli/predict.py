"""``rig predict``: predict vibrations with models."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from rig.cli.kind_group import KindGroup, parameter, with_parameters
from rig.cli.options import Json, Output, Overwrite, keep_existing, show_file

_COMMON = (
    parameter("model", Annotated[Path, typer.Argument(help="Model of one of the kinds that predict.")]),
    parameter("output", Output),
)
_LAST = (parameter("overwrite", Overwrite, False), parameter("json", Json, False))


class PredictGroup(KindGroup):
    """``rig predict``."""

    after: ClassVar[str] = (
        "All kinds have -o, --overwrite (replace OUTPUT) and --json (print JSON); `rig predict KIND --help` shows the others. "
        "Without KIND it is that of the model in FILE; a file that is called like a kind is written ./pnlss."
    )

    def words(self) -> Mapping[str, str]:
        """Return the words for the kinds, each with a sentence for the help."""
        from rig.results.kinds import predictions

        return {word: one.text for word, one in predictions().items()}

    def function(self, word: str) -> Callable[..., None]:
        """Return the function of a kind; of the command without a kind if the word is empty."""
        from rig.cli.option_parameters import parameters_of
        from rig.results.kinds import predictions

        known = predictions()
        models = [known[word].options] if word else [one.options for one in known.values()]
        found: Callable[..., None] = with_parameters(
            lambda values: _predict(word, values),
            [*_COMMON, *parameters_of(models), *_LAST],
            known[word].text if word else "Predict vibrations with a model, and compare them with recordings.",
        )
        return found

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        """Write how the command is called."""
        formatter.write_usage(ctx.command_path, "[KIND] FILE -o OUTPUT [OPTIONS]")


app = typer.Typer(cls=PredictGroup, help="Predict vibrations with a model, and compare them with recordings.")


@app.callback()
def _predict_() -> None:
    """Predict vibrations with a model, and compare them with recordings."""


def _predict(kind: str, values: dict[str, Any]) -> None:
    from rig.cli.option_parameters import given_in
    from rig.results.files import save
    from rig.results.predict import predict_vibrations

    model, output, overwrite, json = (values.pop(name) for name in ("model", "output", "overwrite", "json"))
    given = given_in(values)
    sources = [one for value in given.values() for one in (value if isinstance(value, list) else [value])]
    keep_existing([model, *(one for one in sources if isinstance(one, Path))], output, overwrite)
    save(predict_vibrations(model, given, kind=kind), output)
    show_file(output, json)
