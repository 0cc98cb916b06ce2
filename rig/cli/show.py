"""``rig show`` and ``rig plot``: show the contents of a file."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json, show_file

__all__ = ["plot_", "show"]


def show(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")], json: Json = False
) -> None:
    """What is in a file: points, quality, statistics of the loop."""
    show_file(file, json)


def plot_(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Figure to write: .png, .pdf or .svg.")],
    lateness: Annotated[bool, typer.Option("--lateness", help="How punctual the loop of a recording was.")] = False,
) -> None:
    """Draw what is in a file."""
    from rig.figures.files import plot

    plot(file, output, lateness=lateness)
