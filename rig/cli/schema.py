"""``rig schema`` and ``rig new``: what an editor checks files by, and files to begin with."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import Overwrite

__all__ = ["new", "schema"]


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
        str, typer.Argument(help="bench, plan, rig (a bench with a virtual rig), sensors or driver (folder).")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write; of a driver, the folder.")],
    plan_kind: Annotated[str, typer.Option("--kind", help="Kind of a plan.")] = "backbone",
    bench: Annotated[
        str | None,
        typer.Option(
            help="Of a plan: its bench; default: that of the shipped plan. With --from: bench, or recording, whose limits, "
            "sensors and exciter a rig has."
        ),
    ] = None,
    source: Annotated[
        Path | None, typer.Option("--from", metavar="MODEL", help="Structured model that a rig has as its specimen.")
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
    from rig.text.printable import shown

    if what == "driver":
        new_driver(output, overwrite)
        print(f"{output}: take it apart and put your device in its place (docs/tutorials/a-driver.md)")
        return
    if what not in ("bench", "plan", "rig", "sensors"):
        raise ConfigurationError(f"WHAT = {shown(what)}: allowed is bench, plan, rig, sensors or driver")
    if source is None and (shaker or trust_code):
        raise ConfigurationError(
            f"`{'shaker' if shaker else 'trust_code'}`: is for a rig that begins with a model, `source`"
        )
    table = None if source is None else _identified(what, source, bench, shaker, trust_code)
    beside = new_file(
        what, output, kind=plan_kind, bench=bench, schema_file=schema_file, table=table, overwrite=overwrite
    )
    if table is not None:
        print(f"{output}: {table['description']}")
        return
    one = "file of sensors" if what == "sensors" else what
    print(f"{output}: a {one} to begin with, checked by {beside}")


def _identified(what: str, source: Path, bench: str | None, shaker: str, trust_code: bool) -> dict[str, Any]:
    """Return the table of a bench whose specimen is a structured model."""
    from rig.authoring.structured_rig import bench_like, structured_bench, structured_model
    from rig.errors import ConfigurationError

    if what != "rig":
        raise ConfigurationError(f"`source` = {source}: a model becomes a rig, allowed is `rig new rig`")
    if bench is None:
        raise ConfigurationError(
            "`bench`: is missing, a bench or a recording of one, whose limits, sensors and exciter the rig has"
        )
    model = structured_model(source, trust_code=trust_code)
    return structured_bench(model, bench_like(bench, trust_code=trust_code), shaker=shaker)
