"""``rig schema`` and ``rig new``: what an editor checks files by, and files to begin with."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Overwrite

if TYPE_CHECKING:
    from rig.bench.configuration import Table


def schema(
    what: Annotated[str, typer.Argument(help="bench, plan, rig (parts of a virtual rig), sensors or a kind of plan.")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File to write; default: print it.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """The JSON Schema of benches, plans, virtual rigs or sensors, by which an editor completes and checks their files."""
    from rig.authoring.new_files import schema_text, written
    from rig.authoring.schemas import schema_of

    text = schema_text(schema_of(what))
    if output is None:
        print(text, end="")
    else:
        written({output: text}, overwrite)


def new(
    what: Annotated[
        str,
        typer.Argument(
            help="bench, plan, rig (a bench with a virtual rig), sensors, driver (folder), or mapping of FILES."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write; of a driver, the folder.")],
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="File of time data from which a mapping is proposed, and others with channels of the same test."
        ),
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Format of that file, as `rig import` takes it.")] = "",
    plan_kind: Annotated[str, typer.Option("--kind", help="Kind of a plan.")] = "backbone",
    bench: Annotated[
        str | None,
        typer.Option(
            help="Bench of a plan; default: that of the shipped plan. With --from: bench, or recording, whose limits, "
            "sensors and exciter a rig has."
        ),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="MODEL|DEVICE",
            help="Structured model that a rig has as its specimen; or device that a bench names, as `rig list --devices` has "
            "it: sound:NAME, serial:PORT, nidaqmx:CHASSIS.",
        ),
    ] = None,
    shaker: Annotated[str, typer.Option(help="With --from: a shaker (`rig list`) in place of that of BENCH.")] = "",
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="With --from: import the functions that the model names.")
    ] = False,
    schema_file: Annotated[
        Path | None, typer.Option("--schema", help="Where the schema is written; default: beside OUTPUT.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """A commented file to begin with, every key explained, and its schema for the editor beside it."""
    from rig.authoring.new_files import new_driver, new_file
    from rig.errors import ConfigurationError

    if what == "mapping":
        _mapping(files or [], output, format_, overwrite)
        return
    if files or format_:
        raise ConfigurationError("is for a mapping, `rig new mapping FILE`", field="FILES" if files else "`format`")
    if what == "driver":
        new_driver(output, overwrite)
        print(f"{output}: take it apart and put your device in its place (docs/tutorials/a-driver.md)")
        return
    if what not in ("bench", "plan", "rig", "sensors"):
        raise ConfigurationError(field="WHAT", value=what, allowed="bench, plan, rig, sensors, driver or mapping")
    if source is None and (shaker or trust_code):
        raise ConfigurationError(
            "is for a rig that begins with a model, `source`", field="shaker" if shaker else "trust_code"
        )
    if source is not None and what == "bench":
        _bench_of_device(source, output, schema_file, overwrite)
        return
    table = None if source is None else _identified(what, Path(source), bench, shaker, trust_code)
    beside = new_file(
        what, output, kind=plan_kind, bench=bench, schema_file=schema_file, table=table, overwrite=overwrite
    )
    if table is not None:
        print(f"{output}: {table['description']}")
        return
    one = "file of sensors" if what == "sensors" else what
    print(f"{output}: a {one} to begin with, checked by {beside}")


def _bench_of_device(source: str, output: Path, schema_file: Path | None, overwrite: bool) -> None:
    """Write a bench for a connected device, and a file of sensors beside it if there is none yet."""
    from rig.authoring.device_bench import ON_A_WIRE, bench_of_device, device_named
    from rig.authoring.new_files import new_file, start
    from rig.authoring.ni_bench import bench_of_chassis

    device = device_named(source)
    sensors = output.with_name("sensors.toml")
    table, known = bench_of_device(device, start("bench")), None
    if device.driver == "nidaqmx":
        table, known = bench_of_chassis(device, start("bench"))
    if known is not None:  # read from the sensors themselves: a file of its own, beside one that is kept by hand
        sensors = output.with_name(f"{output.stem}-sensors.toml")
        table["sensors"] = sensors.name
    beside = new_file("bench", output, schema_file=schema_file, table=table, overwrite=overwrite)
    if known is not None or not sensors.exists():
        new_file("sensors", sensors, table=known, overwrite=overwrite)
    print(f"{output}: a bench for {device.name}, checked by {beside}; sensors in {sensors}")
    if device.driver in ON_A_WIRE:
        print(table["description"])
    if device.driver == "sound":
        print("measure its volts, high-passes and latency next: `rig calibrate`")


def _mapping(files: list[Path], output: Path, format_: str, overwrite: bool) -> None:
    from rig.authoring.new_files import written
    from rig.errors import ConfigurationError
    from rig.exchange.proposal.proposal import proposed_mapping

    ConfigurationError.raise_if(
        not files, "is missing", field="FILE", hint="`rig new mapping FILE` looks into a file of time data"
    )
    text, missing = proposed_mapping(files, format_)
    written({output: text}, overwrite)
    left = f"; fill in {' and '.join(missing)}" if missing else ""
    print(
        f"{output}: a mapping proposed for {', '.join(path.name for path in files)}, roles and units to be checked{left}"
    )


def _identified(what: str, source: Path, bench: str | None, shaker: str, trust_code: bool) -> "Table":
    from rig.errors import ConfigurationError
    from rig.results.structured.virtual_bench import bench_like, structured_bench, structured_model

    if what != "rig":
        raise ConfigurationError("a model becomes a rig", field="source", value=source, allowed="`rig new rig`")
    if bench is None:
        raise ConfigurationError(
            "is missing, a bench or a recording of one, whose limits, sensors and exciter the rig has", field="bench"
        )
    model = structured_model(source, trust_code=trust_code)
    return structured_bench(model, bench_like(bench, trust_code=trust_code), shaker=shaker)
