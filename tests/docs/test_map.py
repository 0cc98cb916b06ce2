"""The README's map names every room of the house, and no other."""

import re

import pytest

from tests.docs.pages import ROOT

MAP = (ROOT / "README.md").read_text(encoding="utf-8").split("## What is where")[1].split("\n## ")[0]


def rooms_of(package):
    """Folders and modules directly below a package, as the map writes them."""
    folder = ROOT / package
    folders = {f"{path.name}/" for path in folder.iterdir() if (path / "__init__.py").exists()}
    return folders | {path.name for path in folder.glob("*.py") if path.name != "__init__.py"}


def test_every_room_of_the_bench_is_on_the_map():
    section = re.split(r"^    controller/", MAP, flags=re.MULTILINE)[0]
    named = set(re.findall(r"(?<![\w/])(\w+(?:/|\.py))", section)) - {"rig/"}
    assert rooms_of("rig") <= named


@pytest.mark.parametrize(
    "package", ["rig", "controller", "simulators", "identification", "vibrolock", "tests", "benchmarks", "studies"]
)
def test_every_package_is_on_the_map(package):
    assert re.search(rf"^    {package}/ ", MAP, re.MULTILINE)


def test_the_map_names_the_floors_in_the_order_that_the_contracts_keep():
    contracts = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    floors = re.findall(r'"([^"]+)"', contracts.split('containers = ["rig"]')[1].split("layers = [")[1].split("]")[0])
    section = re.split(r"^    controller/", MAP, flags=re.MULTILINE)[0]
    at = [
        min(
            section.index(f"      {room}") if f"      {room}" in section else section.index(f"  {room}")
            for room in floor.split(" | ")
        )
        for floor in floors
    ]
    assert at == sorted(at)
