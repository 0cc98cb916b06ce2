"""The public names of the packages: what ``__all__`` lists."""

from collections.abc import Iterator
from importlib import import_module

from rig.reference.entry import Entry

__all__ = ["MODULES", "first_line", "name_entries", "public_names"]

MODULES = (
    "rig", "rig.bench", "rig.conformance", "rig.daq", "rig.drivers", "rig.errors", "rig.measurements",
    "controller", "simulators", "simulators.analysis", "simulators.ensemble", "identification", "vibrolock",
)  # fmt: skip
"""Packages and modules whose names are public."""


def public_names(module: str) -> tuple[str, ...]:
    """Return the public names of a module, without those that the package around it has too; none of them is imported."""
    around = public_names(outer) if (outer := module.rpartition(".")[0]) else ()
    return tuple(name for name in getattr(import_module(module), "__all__", ()) if name not in around)


def name_entries() -> Iterator[Entry]:
    """Yield an entry for every public name."""
    for module in MODULES:
        for name in public_names(module):
            full = f"{module}.{name}"
            line = first_line(getattr(import_module(module), name))
            yield Entry("name", full, (name, full), line, full, f"help({full}) says more")


def first_line(thing: object) -> str:
    """Return the first paragraph of a docstring in one line; empty for a value without a docstring of its own."""
    text = getattr(thing, "__doc__", None) if isinstance(thing, type) or callable(thing) else None
    return " ".join((text or "").partition("\n\n")[0].replace("``", "`").split())
