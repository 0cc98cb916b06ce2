"""``rig report``: one page on a test, to read, print and send."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Overwrite, keep_existing


def report_(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Recordings, models, or folders of rig reproduce.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="HTML file to write.")],
    title: Annotated[str, typer.Option(help="Title; by the first file.")] = "",
    overwrite: Overwrite = False,
) -> None:
    """Write one HTML page on a test: what was tested, figures, every point, what was refused, how the loop kept its time."""
    from rig.errors import RecordingError
    from rig.report.report import write_report

    if output.suffix.lower() not in (".html", ".htm"):
        raise RecordingError(f"{output}: reports are written as .html")
    keep_existing(files, output, overwrite)
    write_report(files, output, title)
    print(f"report: {output}")
