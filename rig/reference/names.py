"""The public names of the packages: what ``__all__`` lists."""

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise

from rig.reference.entry import Entry

MODULES = (
    "rig", "rig.bench", "rig.conformance", "rig.daq", "rig.drivers", "rig.errors", "rig.figures", "rig.measurements",
    "controller", "simulators", "simulators.analysis", "simulators.ensemble", "identification",
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
            yield Entry("name", full, (name, full), first_line(module, name), full, f"help({full}) says more")


def first_line(module: str, name: str) -> str:
    """Return the first paragraph of a name's docstring in one line."""
    return " ".join(documentation(module, name).partition("\n\n")[0].replace("``", "`").split())


def documentation(module: str, name: str) -> str:
    """Return the docstring of a class or function, or the one under the line that assigns a constant; empty for none."""
    thing = getattr(import_module(module), name)
    if isinstance(thing, type) or inspect.isroutine(thing):
        return inspect.getdoc(thing) or ""
    return _under_assignment(module, name)


def _under_assignment(module: str, name: str) -> str:
    body = ast.parse(inspect.getsource(import_module(module))).body
    body = [*body, *(inner for line in body if isinstance(line, ast.If) for inner in line.body)]  # names of a face
    for line, after in pairwise([*body, ast.Pass()]):
        match line, after:
            case ast.ImportFrom(module=str(source)), _ if name in [alias.name for alias in line.names]:
                return _under_assignment(source, name)
            case (
                ast.Assign(targets=[ast.Name(id=found)]) | ast.AnnAssign(target=ast.Name(id=found)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ) if found == name:
                return inspect.cleandoc(text)
    return ""
