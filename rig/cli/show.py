"""``rig show`` and ``rig plot``: show the contents of a file."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json, show_file

SCREEN = "screen"
"""Style without a wish."""


def show(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")], json: Json = False
) -> None:
    """What is in a file: points, quality, statistics of the loop."""
    show_file(file, json)


def plot_(
    files: Annotated[list[Path], typer.Argument(metavar="FILE", help="Recordings, models or imported measurements.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Figure to write: .png, .pdf, .svg, or .html to zoom.")
    ],
    label: Annotated[list[str] | None, typer.Option(help="Name in the legend; once for each file.")] = None,
    amplitude: Annotated[str | None, typer.Option(help="Axis of amplitudes: linear, log or dB.")] = None,
    channel: Annotated[str, typer.Option(help="Sensor to show; by default the drive point.")] = "",
    harmonic: Annotated[int, typer.Option(help="Harmonic to show.")] = 1,
    frequency: Annotated[str, typer.Option(metavar="LOW:HIGH", help="Ends of the frequency axis, Hz.")] = "",
    panels: Annotated[
        str, typer.Option(metavar="NAMES", help="Parts of a recording's figure: backbone, history; by a comma.")
    ] = "",
    lateness: Annotated[bool, typer.Option("--lateness", help="How punctual the loop of a recording was.")] = False,
    style: Annotated[
        str, typer.Option(help="screen, paper (one column, 85 mm), slide (16:9), or a style sheet of matplotlib.")
    ] = SCREEN,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height, mm, or the width alone.")] = "",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace OUTPUT also where it is not a figure of this program.")
    ] = False,
) -> None:
    """Draw what is in a file; of several files, or with axes of one's own, their curves over one another."""
    from rig.drawing.curves import View
    from rig.drawing.style import restyle
    from rig.figures.files import plot

    view = View(amplitude, channel, harmonic, _limits_hz(frequency))
    _refuse_looks_of_a_page(output, style=style if style != SCREEN else "", size=size)
    restyle(style, size_mm=_size_mm(size))
    try:
        chosen = None if view == View() else view
        names = [name.strip() for name in panels.split(",") if name.strip()]
        plot(files, output, lateness=lateness, labels=label or (), view=chosen, panels=names, overwrite=overwrite)
    finally:
        restyle()
    print(f"figure: {output}")


def _refuse_looks_of_a_page(output: Path, **given: str) -> None:
    """Refuse style and size for a figure in a browser, which takes the window's size and its own looks."""
    from rig.errors import RecordingError

    for name, value in given.items():
        if value and output.suffix.lower() == ".html":
            raise RecordingError(
                f"`{name}` {value}: is for .png, .pdf and .svg; {output} fits itself to the window of the browser"
            )


def _size_mm(text: str) -> tuple[float, float | None] | None:
    from rig.errors import RecordingError

    width, _, height = text.lower().removesuffix("mm").partition("x")
    try:
        return (float(width), float(height) if height else None) if text else None
    except ValueError:
        raise RecordingError(
            f"`size` {text}: write width and height in mm, such as 85x60, or the width alone"
        ) from None


def _limits_hz(text: str) -> tuple[float, float] | None:
    from rig.errors import RecordingError

    low, _, high = text.partition(":")
    try:
        return (float(low), float(high)) if text else None
    except ValueError:
        raise RecordingError(f"`frequency` {text}: write both ends in Hz, such as 24:25.5") from None
