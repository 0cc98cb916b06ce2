"""The public names of the packages: what ``__all__`` lists."""

from collections.abc import Iterator
from importlib import import_module

from rig.reference.entry import Entry

__all__ = ["MODULES", "name_entries", "public_names"]

MODULES = (
    "rig", "rig.bench", "rig.conformance", "rig.daq", "rig.drivers", "rig.errors", "rig.measurements",
    "controller", "simulators", "simulators.analysis", "identification", "vibrolock",
)  # fmt: skip
"""Packages and modules whose names are public."""


def public_names(module: str) -> tuple[str, ...]:
    """Return the public names of a module, without importing what they stand for."""
    return tuple(getattr(import_module(module), "__all__", ()))


def name_entries(word: str | None = None) -> Iterator[Entry]:
    """Yield an entry for every public name, or for those that are found under ``word``; these names are imported."""
    for module in MODULES:
        for name in public_names(module):
            full = f"{module}.{name}"
            if word is None or word in (name.lower(), full.lower()):
                line = first_line(getattr(import_module(module), name))
                yield Entry("name", full, (name, full), line, full, f"help({full}) has the details")


def first_line(thing: object) -> str:
    """Return the first paragraph of a docstring in one line; empty for a value without a docstring of its own."""
    text = getattr(thing, "__doc__", None) if isinstance(thing, type) or callable(thing) else None
    return " ".join((text or "").partition("\n\n")[0].split())
