"""``rig doctor``: what this machine and a bench's device can promise."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json

__all__ = ["doctor"]


def doctor(
    daq: Annotated[
        str | None, typer.Option(help="Bench whose device to look at: a name or TOML file. It is given 0 V only.")
    ] = None,
    json: Json = False,
) -> None:
    """What this machine can promise: clock, privileges, disk, drivers; with --daq, what a bench's device answers."""
    from rig.bench import load_bench
    from rig.loop.doctor import examine, examine_bench
    from rig.text.console import print_json
    from rig.text.printable import printable_strings

    facts = examine(Path.cwd()) if daq is None else examine_bench(load_bench(daq))
    if json:
        print_json(facts)
    else:
        for name, value in printable_strings(facts).items():
            text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
            text = "; ".join(value) or "none" if isinstance(value, list) else text
            print(f"{name.replace('_', ' '):22} {text}")
    if facts.get("failure"):
        raise typer.Exit(1)
