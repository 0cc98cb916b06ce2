"""``rig firmware``: the loop's own kernels for the processor of a device."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.group import Group

app = typer.Typer(cls=Group, no_args_is_help=True, help="The loop's own kernels for the processor of a device.")


@app.callback()
def _common() -> None:
    """The loop's own kernels for the processor of a device."""


@app.command("tick")
def tick_(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to; it is made if need be.")],
    target: Annotated[str, typer.Option(help="cortex-m7, cortex-m33 or host.")] = "cortex-m7",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of another content there.")] = False,
) -> None:
    """Compile the tick, from measurement to output: an object file, its C header, and a text of sizes and digest."""
    from rig.firmware.build import build_tick

    built = build_tick(target, output, overwrite=overwrite)
    facts = built.facts
    print(f"{built.object}: {facts.code} bytes of code, {facts.constants} of constants, {facts.data} of variables")
    print(f"{built.header}: its records, and how it is called")
    print(f"{built.text}: to be linked: {', '.join(facts.undefined)}")
    print(f"digest {built.digest}")
