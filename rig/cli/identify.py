"""``rig identify``: identify models from recordings."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from rig.cli.kind_group import KindGroup, parameter, with_parameters
from rig.cli.options import Json, Output, Overwrite, keep_existing, show_file

_COMMON = (
    parameter(
        "files", Annotated[list[Path], typer.Argument(help="Recordings, or imported measurements, taken together.")]
    ),
    parameter("output", Output),
)
_LAST = (parameter("overwrite", Overwrite, False), parameter("json", Json, False))
_KIND = Annotated[str, typer.Option("--model", help="Kind of model.")]


class IdentifyGroup(KindGroup):
    """``rig identify``."""

    after: ClassVar[str] = (
        "Files are recordings or imported measurements, taken together. All kinds have -o, --overwrite (replace OUTPUT) and "
        "--json (print JSON); `rig identify KIND --help` shows the others. Without KIND it is nonlinear-mode, or that of "
        "--model; a file that is called like a kind is written ./pnlss."
    )

    def words(self) -> Mapping[str, str]:
        """Return the words for the kinds, each with a sentence for the help."""
        from rig.results.kinds import identifications

        return {word: one.text for word, one in identifications().items()}

    def function(self, word: str) -> Callable[..., None]:
        """Return the function of a kind; of the command without a kind if the word is empty."""
        from rig.cli.option_parameters import parameters_of
        from rig.results.kinds import identifications

        known = identifications()
        models = [known[word].options] if word else [one.options for one in known.values()]
        kind = () if word else (parameter("kind", _KIND, next(iter(known))),)
        found: Callable[..., None] = with_parameters(
            lambda values: _identify(word or values.pop("kind"), values),
            [*_COMMON, *kind, *parameters_of(models), *_LAST],
            known[word].text if word else "Turn recordings into a model.",
        )
        return found


app = typer.Typer(cls=IdentifyGroup, help="Turn recordings into a model.")


@app.callback()
def _identify_() -> None:
    """Turn recordings into a model."""


def _identify(kind: str, values: dict[str, Any]) -> None:
    from rig.cli.option_parameters import given_in
    from rig.errors import ConfigurationError
    from rig.results.files import save
    from rig.results.identify import identify_model
    from rig.results.kinds import identifications
    from rig.show.progress import FitLines
    from rig.system.stop_signals import escalating

    files, output, overwrite, json = (values.pop(name) for name in ("files", "output", "overwrite", "json"))
    known = identifications()
    given = given_in(values, known[kind].options if kind in known else None, output)
    keep_existing([*files, *given.get("validation", ())], output, overwrite or "resume" in given)
    if kind not in known:
        raise ConfigurationError(field="kind", value=kind, allowed=known)
    options = known[kind].options(**given)
    with escalating() as signals:
        lines = FitLines(signals.check)
        try:
            found = identify_model(files, options, progress=lines)
        finally:
            lines.close()
    save(found, output)
    show_file(output, json)
    if line := known[kind].remark(found, output):
        print(f"rig: {line.text}", file=sys.stderr)
        if line.unfinished:
            raise typer.Exit(1)
