"""Kinds of results: every address of a declaration leads somewhere, and kinds know nothing of each other."""

import re
import tomllib
from pathlib import Path
from pkgutil import resolve_name

import pytest

import rig.results
from rig.results.kinds import KINDS, all_kinds

FOLDER = Path(rig.results.__file__).parent
ABOVE = {"identify", "predict", "in_memory"}
"""What stands above the kinds."""
SHARED = {"simulated", "predictions", "measured", "files", "kinds", "kind", "options"}
"""What kinds share, one of which is a kind as well."""
OWN = {name.replace("-", "_") for name in KINDS} - SHARED


def addresses(value):
    """Every address in a declaration."""
    if isinstance(value, str):
        yield from [value] if ":" in value else []
    elif isinstance(value, tuple):
        for one in value:
            yield from addresses(one)
    elif hasattr(value, "__dict__"):
        for one in vars(value).values():
            yield from addresses(one)


@pytest.mark.parametrize("kind", list(all_kinds()), ids=lambda kind: kind.name)
def test_every_address_of_a_declaration_leads_somewhere(kind):
    found = list(addresses(kind))
    assert len(found) >= 3
    for one in found:
        resolve_name(one)
    assert kind.stored == (KINDS.get(kind.name) is kind)


@pytest.mark.parametrize("folder", sorted(OWN))
def test_a_kind_imports_what_kinds_share_and_no_other_kind(folder):
    for path in (FOLDER / folder).glob("*.py"):
        imported = re.findall(r"^\s*from rig\.results\.(\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(imported) <= SHARED | {folder}, path


def test_what_is_shared_imports_no_kind_and_the_contract_names_all_of_it():
    for name in SHARED:
        paths = (FOLDER / name).glob("*.py") if (FOLDER / name).is_dir() else [FOLDER / f"{name}.py"]
        for path in paths:
            imported = re.findall(r"^\s*from rig\.results\.(\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert set(imported) <= SHARED, path
    root = FOLDER.parents[1] / "pyproject.toml"
    contracts = tomllib.loads(root.read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    (layers,) = [one["layers"] for one in contracts if one.get("containers") == ["rig.results"]]
    named = {name for layer in layers for name in layer.split(" | ")}
    assert named == ABOVE | SHARED
    there = {path.stem for path in FOLDER.iterdir() if path.name.endswith(".py") or (path / "__init__.py").exists()}
    assert there - {"__init__"} == ABOVE | SHARED | OWN
