"""Shipped specimens and shakers: tables in TOML beside this package, every number labelled with where it comes from."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from vibrolock.errors import InputError


def shipped_specimens() -> tuple[str, ...]:
    """Return the names of the shipped specimens."""
    folder = files("simulators") / "specimens"
    return tuple(sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")))


def specimen_table(name: str) -> dict[str, Any]:
    """The whole table of a shipped specimen; `ValueError` names those there are."""
    InputError.unless_one_of("specimen", name, shipped_specimens())
    return tomllib.loads((files("simulators") / "specimens" / f"{name}.toml").read_text(encoding="utf-8"))


@cache
def _shakers() -> dict[str, dict[str, Any]]:
    return tomllib.loads((files("simulators") / "shakers.toml").read_text(encoding="utf-8"))


def shaker_descriptions() -> dict[str, str]:
    """What every shaker is and where its numbers come from, by name."""
    return {name: f"{table['description']}; {table['source']}" for name, table in _shakers().items()}


def shaker_values(name: str) -> dict[str, Any]:
    """The keys of an exciter that a shaker has; `ValueError` names the shakers there are."""
    InputError.unless_one_of("shaker", name, _shakers())
    return {key: value for key, value in _shakers()[name].items() if key not in ("description", "source")}


GEOMETRY = ("material", "youngs_modulus_pa", "diameter_m", "length_m")
"""Keys of a stinger from which its stiffness follows."""


def with_parts_of(specimen: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A specimen with ``changes``; another shaker, or another stinger by geometry, replaces the specimen's values."""
    base = dict(specimen)
    exciter, stinger = changes.get("exciter"), changes.get("stinger")
    if isinstance(exciter, dict) and "shaker" in exciter:
        base.pop("exciter", None)
    if isinstance(stinger, dict) and any(key in stinger for key in GEOMETRY) and isinstance(base.get("stinger"), dict):
        base["stinger"] = {key: value for key, value in base["stinger"].items() if key != "stiffness_n_m"}
    return merged(base, changes)


def merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """``base`` with ``changes``: tables key by key, anything else replaced whole; so is a table of another ``kind``."""
    result = dict(base)
    for key, value in changes.items():
        old = base.get(key)
        same_kind = (
            isinstance(old, dict) and isinstance(value, dict) and value.get("kind", old.get("kind")) == old.get("kind")
        )
        result[key] = merged(old, value) if isinstance(old, dict) and same_kind else value
    return result
