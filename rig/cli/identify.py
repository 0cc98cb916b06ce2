"""``rig identify``: identify models from recordings."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.kind_group import KindGroup, kind_app, parameter
from rig.cli.options import keep_existing, show_file

if TYPE_CHECKING:
    from rig.results.kind import Identification


class IdentifyGroup(KindGroup):
    """``rig identify``."""

    text = "Turn recordings into a model."
    usage = "[KIND] FILE... -o OUTPUT [OPTIONS]"
    after = (
        "Files are recordings or imported measurements, taken together. All kinds have -o, --overwrite (replace OUTPUT) and "
        "--json (print JSON); `rig identify KIND --help` shows the others. Without KIND it is nonlinear-mode, or that of "
        "--model; a file with the name of a kind is written ./pnlss."
    )
    files = parameter(
        "files", Annotated[list[Path], typer.Argument(help="Recordings, or imported measurements, taken together.")]
    )
    kind = (parameter("kind", Annotated[str, typer.Option("--model", help="Kind of model.")], "nonlinear-mode"),)

    def kinds(self) -> "Mapping[str, Identification]":
        """Return how models are identified, by the words for their kinds."""
        from rig.results.kinds import identifications

        return identifications()

    def run(self, word: str, output: Path, overwrite: bool, json: bool, values: dict[str, Any]) -> None:
        """Identify a model and show it."""
        from rig.cli.option_parameters import given_in
        from rig.errors import ConfigurationError
        from rig.results.files import save
        from rig.results.identify import identify_model
        from rig.show.progress import FitLines
        from rig.show.waiting import Waiting
        from rig.system.stop_signals import escalating

        files, kind, known = values.pop("files"), word or values.pop("kind"), self.kinds()
        given = given_in(values, known[kind].options if kind in known else None, output)
        keep_existing([*files, *given.get("validation", ())], output, overwrite or "resume" in given)
        ConfigurationError.unless_one_of("kind", kind, known)
        options = known[kind].options(**given)
        with escalating() as signals:
            lines = FitLines(signals.check)
            try:
                with Waiting(f"identifying the {kind} model from {', '.join(map(str, files))}"):
                    found = identify_model(files, options, progress=lines)
            finally:
                lines.close()
        save(found, output)
        show_file(output, json)
        if line := known[kind].remark(found, output):
            print(f"rig: {line.text}", file=sys.stderr)
            if line.unfinished:
                raise typer.Exit(1)


app = kind_app(IdentifyGroup)
