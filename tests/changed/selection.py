"""Which test files can depend on the files that changed."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from grimp import ImportGraph
from grimp.exceptions import GrimpException

from tests.changed.graph import PACKAGES, complete, drivers, import_graph, packages_around, sources

_TEST = re.compile(r"tests\.(?:.*\.)?test_\w+")
_BY_EVERY_RUN = "rig/pytest_plugin.py"
_READS_ALL = re.compile(r"\bimport_module\(|[\"']import \{|\bimport_graph\(")
"""Tests that import what they are parametrized with, or read every import."""
_READS_PAGES = re.compile(r"\bfor \w+ in pages\(\)")


@dataclass(frozen=True)
class Selection:
    """Modules of tests that can depend on a change and that cannot; why all of them can, if so."""

    kept: frozenset[str]
    left: frozenset[str]
    all_for: str = ""


def select(changed: Iterable[str], root: Path) -> Selection:
    """Select among the tests of a project."""
    try:
        graph = import_graph(root)
        text = sources(graph, root)
        complete(graph, text, drivers(root))
    except (GrimpException, SyntaxError) as error:
        return Selection(frozenset(), frozenset(), f"the imports cannot be read: {error}")
    return selected(changed, graph, text)


def selected(changed: Iterable[str], graph: ImportGraph, text: Mapping[str, str]) -> Selection:
    """Select by what changed, imports that are complete, and the source of every module.

    Files are paths from the root of the project, with slashes; some may be gone.
    """
    changed = sorted(changed)
    tests = frozenset(filter(_TEST.fullmatch, text))
    begin: set[str] = set()
    for path in changed:
        found = _depending(path, graph, text)
        if found is None:
            return Selection(tests, frozenset(), f"any may depend on {path}")
        begin |= found
    if any(path.split("/")[0] in {*PACKAGES} - {"tests"} for path in changed):
        begin |= _pages(text) | {module for module in tests if _READS_ALL.search(text[module])}
    reached = begin.union(*map(graph.find_downstream_modules, begin))
    return Selection(tests & reached, tests - reached)


def _depending(path: str, graph: ImportGraph, text: Mapping[str, str]) -> set[str] | None:
    """Return the modules that a file is or that read it; None if these may be any."""
    file = PurePosixPath(path)
    parts = file.with_suffix("").parts
    module = ".".join(parts).removesuffix(".__init__")
    if path == _BY_EVERY_RUN:
        return None
    if file.suffix == ".py" and module in graph.modules:
        return {module, f"{module}.__init__"} & graph.modules
    if parts[0] == "docs" or (len(parts) == 1 and file.suffix == ".md"):
        copied = {"rig.authoring.new_files"} if parts[:2] == ("docs", "driver-template") else set()
        return _pages(text) | _naming(file, text) | copied
    if parts[0] == "firmware":
        return _pages(text) | (_below("tests.firmware", graph) or set())
    if file.suffix == ".py" and file.stem != "conftest":
        return _still_naming(module, graph, text)
    return _below(
        next((package for package in packages_around(".".join(parts)) if package in graph.modules), ""), graph
    )


def _pages(text: Mapping[str, str]) -> set[str]:
    """Return the tests of the documentation, which uses everything, and those that read all of its pages."""
    return {
        module
        for module, own in text.items()
        if module.startswith("tests.docs.test_") or (module.startswith("tests.") and _READS_PAGES.search(own))
    }


def _naming(file: PurePosixPath, text: Mapping[str, str]) -> set[str]:
    """Return the tests that name a file of the documentation, or search its folder."""
    folder = re.escape(file.parent.name or ".")
    searched = re.compile(rf"[\"'/]{folder}[\"'/].*glob\(", re.DOTALL)
    return {
        module
        for module, own in text.items()
        if module.startswith("tests.") and module != "tests.docs.pages" and (file.name in own or searched.search(own))
    }


def _still_naming(module: str, graph: ImportGraph, text: Mapping[str, str]) -> set[str] | None:
    """Return the modules that name one that is gone; None if its package is gone too."""
    package, _, name = module.rpartition(".")
    if package not in graph.modules:
        return None
    named = re.compile(rf"\b{re.escape(module)}\b|\bfrom {re.escape(package)} import [^=]*\b{re.escape(name)}\b")
    return {other for other, own in text.items() if named.search(own)}


def _below(package: str, graph: ImportGraph) -> set[str] | None:
    """Return the modules of a package; None for all tests, and for no package."""
    return None if package in ("", "tests") else {package, *graph.find_descendants(package)}
