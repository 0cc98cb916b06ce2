"""The shipped specimens: tables in TOML beside this package, every number labelled with where it comes from."""

import tomllib
from importlib.resources import files
from typing import Any

__all__ = ["merged", "shipped_specimens", "specimen_table"]


def shipped_specimens() -> tuple[str, ...]:
    """Return the names of the shipped specimens."""
    folder = files("simulators") / "specimens"
    return tuple(sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")))


def specimen_table(name: str) -> dict[str, Any]:
    """The whole table of a shipped specimen; `ValueError` names those there are."""
    if name not in shipped_specimens():
        raise ValueError(f"specimen = {name!r}: allowed is one of {', '.join(shipped_specimens())}")
    return tomllib.loads((files("simulators") / "specimens" / f"{name}.toml").read_text(encoding="utf-8"))


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
