"""Imports of projects that tests make up."""

import ast

from grimp import ImportGraph

from tests.changed.graph import complete

DRIVER = "rig.drivers.virtual"


def made_up(more: dict[str, str]) -> tuple[ImportGraph, dict[str, str]]:
    """Return imports and sources of a small project with further modules."""
    text = {
        "vibrolock": "",
        "vibrolock.on_use": "",
        "vibrolock.results": "",
        "controller": on_use("controller", {"Detector": "detector", "Law": "law"}),
        "controller.detector": "",
        "controller.law": "from controller.detector import Detector",
        "rig": "",
        "rig.cli": "from rig.text import line",
        "rig.drivers": "",
        "rig.drivers.virtual": "",
        "rig.figures": "",
        "rig.text": "",
        "tests": "",
        "tests.conftest": "",
        "tests.docs": "",
        "tests.docs.test_pages": "",
        "tests.firmware": "",
        "tests.firmware.test_arm": "",
        "tests.rig": "",
    } | more
    graph = ImportGraph()
    for module in text:
        graph.add_module(module)
    for module, own in text.items():
        for imported in _imported(own) & text.keys():
            graph.add_import(importer=module, imported=imported)
    complete(graph, text, [DRIVER])
    return graph, text


def on_use(package: str, module_of: dict[str, str]) -> str:
    """Return the source of a package with names that are imported on use."""
    imports = "".join(f"    from {package}.{module} import {name}\n" for name, module in module_of.items())
    return (
        "from vibrolock.on_use import on_use\n"
        f"if TYPE_CHECKING:\n{imports}else:\n    __getattr__, __dir__, __all__ = on_use(__name__)\n"
    )


def _imported(text: str) -> set[str]:
    nodes = list(ast.walk(ast.parse(text)))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return names | {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
