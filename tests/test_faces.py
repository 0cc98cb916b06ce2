"""Libraries are used through the faces of their packages, at most two levels deep; only a test of its mirror looks behind."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIBRARIES = ("controller", "identification", "simulators")
USERS = ("benchmarks", "rig", "studies", "tests")
MODULES_IN_PLACE_OF_FACES = {"simulators.ensemble"}
"""Modules whose names are public by themselves; they stand in the reference."""


def path_of(module: str) -> Path:
    return ROOT.joinpath(*module.split("."))


def is_face(module: str) -> bool:
    """Whether others may import from a module: a library, or a package directly in it."""
    return module in MODULES_IN_PLACE_OF_FACES or (
        module.count(".") < 2 and (path_of(module) / "__init__.py").is_file()
    )


def imported(source: str) -> Iterator[str]:
    """Modules that a source imports, or imports names from; a module that is imported as a name counts as such."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name for name in names if path_of(name).is_dir() or path_of(name).with_suffix(".py").is_file())


def behind_a_face(source: str, own: str = "") -> list[str]:
    """Modules of the libraries but of the library ``own`` that a source imports although they are no faces."""
    found = (name for name in imported(source) if name.partition(".")[0] in LIBRARIES)
    return [name for name in found if name.partition(".")[0] != own and not is_face(name)]


def test_an_import_from_behind_a_face_is_seen():
    assert behind_a_face("from controller.detector import detect") == ["controller.detector"]
    assert behind_a_face("import simulators.plant.kernels") == ["simulators.plant.kernels"]
    assert behind_a_face("from controller import law, Law") == ["controller.law"]
    assert behind_a_face("from controller.tuning import PlantModel, plant") == ["controller.tuning.plant"]
    assert behind_a_face("def f():\n    from identification.errors import IdentificationError") != []
    assert behind_a_face("from controller.detector import detect", own="controller") == []
    assert (
        behind_a_face("from controller.tuning import PlantModel\nimport identification\nfrom rig.tick import tick")
        == []
    )


@pytest.mark.parametrize("user", USERS)
def test_libraries_are_used_through_their_faces(user):
    found = []
    for path in sorted((ROOT / user).rglob("*.py")):
        parts = path.relative_to(ROOT).parts
        own = parts[1] if user == "tests" else ""  # a test of a private module lies beside its mirror
        found += [f"{'/'.join(parts)}: {name}" for name in behind_a_face(path.read_text(encoding="utf-8"), own)]
    assert found == []


def test_the_contract_lists_every_module_that_is_no_face():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (contract,) = [one for one in contracts if one["name"].startswith("Faces:")]
    modules = {
        f"{library}.{path.stem}"
        for library in LIBRARIES
        for path in (ROOT / library).glob("*.py")
        if path.stem != "__init__"
    }
    wanted = {*(modules - MODULES_IN_PLACE_OF_FACES), *(f"{library}.*.*" for library in LIBRARIES)}
    assert set(contract["forbidden_modules"]) == wanted
