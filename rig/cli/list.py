"""``rig list``: shipped benches, plans, specimens and shakers, the parts of a virtual rig, and the devices of this computer."""

from importlib import resources
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rig.drivers.virtual.parts import Key, Part, PartKeys


def list_(
    part: Annotated[str | None, typer.Argument(help="A part of a virtual rig, whose keys are printed.")] = None,
    devices: Annotated[
        bool, typer.Option("--devices", help="Serial ports, CAN interfaces, sound and NI devices of this computer.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")] = False,
) -> None:
    """Shipped benches, plans, specimens and shakers, installed drivers, and the parts that a virtual rig is built from."""
    from rig.drivers import driver_names
    from rig.drivers.virtual.parts import part_keys, parts, specimens
    from rig.text.console import print_json
    from simulators.parts import shaker_descriptions

    if devices:
        _print_devices(part, json)
        return
    if part is not None:
        found = part_keys(part)
        if json:
            print_json({**found._asdict(), "keys": [key._asdict() for key in found.keys]})
        else:
            _print_part(found)
        return
    named = {
        "benches": _shipped_in("rig.bench"),
        "plans": _shipped_in("rig.campaigns"),
        "specimens": specimens(),
        "shakers": [{"name": name, "description": text} for name, text in shaker_descriptions().items()],
    }
    if json:
        print_json({**named, "drivers": driver_names(), "parts": [one._asdict() for one in parts()]})
    else:
        _print_everything(named, driver_names(), parts())


def _print_devices(part: str | None, json: bool) -> None:
    """Print what a bench may name as its device, as lines for the bench."""
    import tomli_w

    from rig.drivers.devices import attached_devices
    from rig.errors import ConfigurationError
    from rig.text.console import print_json

    if part is not None:
        raise ConfigurationError("allowed is either a part or --devices", where=part)
    found = attached_devices()
    if json:
        print_json({"devices": [one._asdict() for one in found.devices], "missing": found.missing})
        return
    for device in found.devices:
        print(f"# {device.name}" + (f": {device.about}" if device.about else ""))
        print(tomli_w.dumps({"driver": {"name": device.driver, "options": device.options}}))
    if not found.devices:
        print("# no device was found")
    for reason in found.missing:
        print(f"# {reason}")


def _shipped_in(package: str) -> list[dict[str, str]]:
    from rig.bench.configuration import shipped_descriptions

    found = shipped_descriptions(Path(str(resources.files(package))) / "shipped")
    return [{"name": name, "description": description} for name, description in found.items()]


def _print_everything(named: dict[str, list[dict[str, str]]], drivers: list[str], parts: "list[Part]") -> None:
    width = max(len(row["name"]) for rows in named.values() for row in rows)
    for heading, rows in named.items():
        print(f"{heading}:")
        for row in rows:
            print(f"  {row['name']:{width}}  {' '.join(row['description'].split())}")
    print(f"drivers:\n  {', '.join(drivers)}")
    print("parts of a virtual rig (rig list NAME for the keys of one):")
    for part in parts:
        choices = "; ".join(f"{key}: {', '.join(words)}" for key, words in part.choices.items())
        print(f"  {part.group:10} {part.name:23} {part.description}" + (f" ({choices})" if choices else ""))


def _print_part(part: "PartKeys") -> None:
    where = part.group if part.name == part.group else f"{part.group}, {part.name}"
    print(f"{where}\n\n{part.description.replace('``', '')}\n")
    for key in part.keys:
        facts = ", ".join(text for text in (key.type, key.unit, _default(key)) if text)
        print(f"{key.key}: {facts}\n    {key.description}")


def _default(key: "Key") -> str:
    if key.required:
        return "required"
    return "optional" if key.default is None else f"default {dumps(key.default)}"
