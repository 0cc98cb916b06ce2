"""The commands ``rig import`` and ``rig export``."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json, Output, Overwrite, keep_existing, show_file


def import_(
    file: Annotated[
        Path,
        typer.Argument(help="MAT, UFF, CSV, Excel, HDF5, NetCDF, NumPy, LabVIEW, WAV, TDMS, MDF 4 or SEP005 file."),
    ],
    output: Output,
    mapping: Annotated[Path | None, typer.Option(help="TOML file that says what is where in it.")] = None,
    format_: Annotated[
        str,
        typer.Option(
            "--format", help="mat, uff, csv, hdf5, wav, tdms, mdf4, lvm, npz, xlsx or sep005; by the file's ending."
        ),
    ] = "",
    units: Annotated[str, typer.Option(help="UFF with unclear units: labels, file (dataset 164) or si.")] = "",
    drive: Annotated[str, typer.Option(help="UFF with modes: where the force acts, such as 1+Z.")] = "",
    item: Annotated[int, typer.Option(help="Which object, where the file holds several.", min=0)] = 0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Bring in measurements, time data and modes from elsewhere."""
    from rig.exchange.reading import import_file
    from rig.results.files import save
    from rig.results.time_data.series import TimeData, records_of_series

    keep_existing([file], output, overwrite)
    found = import_file(file, format_, mapping, units=units, drive=drive, item=item)
    save(records_of_series(found) if isinstance(found, TimeData) else found, output)
    show_file(output, json)


def export_(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")],
    output: Output,
    to: Annotated[str, typer.Option("--to", help="uff, mat or csv; by the ending of OUTPUT.")] = "",
    data: Annotated[
        str, typer.Option(help="What to export of a recording: results, or time (samples of its points).")
    ] = "results",
    point: Annotated[
        list[int] | None, typer.Option(help="Point whose samples are wanted, from 1; may be repeated.", min=1)
    ] = None,
    item: Annotated[int, typer.Option(help="Which object, where the file holds several.", min=0)] = 0,
    encoding: Annotated[
        str, typer.Option(help="UFF: ascii or binary; else time data are binary, all else ASCII.")
    ] = "",
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write what is in a file for other programs."""
    from rig.exchange.export import export_file
    from rig.exchange.sources import EXPORTS, format_of
    from rig.text.console import print_json
    from vibrolock.printable import printable_strings

    format_ = format_of(output, to, "--to", EXPORTS)
    keep_existing([file], output, overwrite)
    numbers = tuple(number - 1 for number in point or ())
    written = export_file(file, output, format_, data=data, points=numbers, item=item, encoding=encoding)
    if json:
        print_json({"file": str(output), "format": format_, "written": [one.summary() for one in written]})
        return
    for one in written:
        told = printable_strings(one.summary())
        rows = f"{told['rows']} rows of " if told["rows"] else ""
        print(f"{told['kind']}: {told['title']}, {rows}{', '.join(told['arrays'])}")
