"""``rig list``: shipped benches, plans, specimens and shakers, and the parts of a virtual rig."""

from importlib import resources
from json import dumps
from pathlib import Path
from typing import Annotated, Any

import typer


def list_(
    part: Annotated[str | None, typer.Argument(help="A part of a virtual rig, whose keys are printed.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")] = False,
) -> None:
    """Shipped benches, plans, specimens and shakers, installed drivers, and the parts that a virtual rig is built from."""
    from rig.drivers.virtual.parts import part_keys
    from rig.text.console import print_json

    if part is not None:
        keys = part_keys(part)
        print_json(keys) if json else _print_part(keys)
        return
    everything = _everything()
    print_json(everything) if json else _print_everything(everything)


def _everything() -> dict[str, Any]:
    from rig.drivers import driver_names
    from rig.drivers.virtual.parts import parts, specimens
    from simulators.parts import shaker_descriptions

    shakers = [{"name": name, "description": text} for name, text in shaker_descriptions().items()]
    return {
        "benches": _shipped_in("rig.bench"),
        "plans": _shipped_in("rig.campaigns"),
        "drivers": driver_names(),
        "specimens": specimens(),
        "shakers": shakers,
        "parts": parts(),
    }


def _shipped_in(package: str) -> list[dict[str, str]]:
    from rig.bench.configuration import shipped_descriptions

    found = shipped_descriptions(Path(str(resources.files(package))) / "shipped")
    return [{"name": name, "description": description} for name, description in found.items()]


def _print_everything(everything: dict[str, Any]) -> None:
    headings = ("benches", "plans", "specimens", "shakers")
    width = max(len(row["name"]) for heading in headings for row in everything[heading])
    for heading in headings:
        print(f"{heading}:")
        for row in everything[heading]:
            print(f"  {row['name']:{width}}  {' '.join(row['description'].split())}")
    print(f"drivers:\n  {', '.join(everything['drivers'])}")
    print("parts of a virtual rig (rig list NAME for the keys of one):")
    for part in everything["parts"]:
        choices = "; ".join(f"{key}: {', '.join(words)}" for key, words in part["choices"].items())
        line = f"  {part['group']:10} {part['name']:23} {part['description']}"
        print(line + (f" ({choices})" if choices else ""))


def _print_part(part: dict[str, Any]) -> None:
    group = part["group"]
    where = group if part["name"] == group else f"{group}, {part['name']}"
    print(f"{where}\n\n{part['description'].replace('``', '')}\n")
    for key in part["keys"]:
        facts = ", ".join(text for text in (key["type"], key["unit"], _default(key)) if text)
        print(f"{key['key']}: {facts}\n    {key['description']}")


def _default(key: dict[str, Any]) -> str:
    if key["required"]:
        return "required"
    return "optional" if key["default"] is None else f"default {dumps(key['default'])}"
