"""Files of models and measurements in which every field holds something: those of an earlier version are read equal."""

import json
import lzma
from pathlib import Path

import pytest

from rig.exchange.reading import import_file
from rig.results.files import load, save
from tests.flattened import flattened

FOLDER = Path(__file__).parent / "every_field"
CONTENTS = json.loads(lzma.decompress((FOLDER / "contents.json.xz").read_bytes()))
"""By the name of the file: path and value of all fields, as the version had them that wrote the file."""
EXCHANGED = sorted(path.name.removesuffix(".mat.xz") for path in FOLDER.glob("*.mat.xz"))
RENAMED = {"stopped": "message"}
"""Fields that have another name now."""
FLAGS = {"limited": "still-improving", "interrupted": "interrupted"}
"""Flags of a fit that its status holds now."""


def unpacked(name: str, folder: Path) -> Path:
    path = folder / name
    path.write_bytes(lzma.decompress((FOLDER / f"{name}.xz").read_bytes()))
    return path


def differing(found, name: str) -> dict[str, tuple]:
    """Values now and then, by their paths then, where they differ; NaN is equal to NaN."""
    now = json.loads(json.dumps(dict(flattened(found))))
    pairs = {path: (value_at(path, now), then) for path, then in CONTENTS[name].items()}
    return {path: pair for path, pair in pairs.items() if json.dumps(pair[0]) != json.dumps(pair[1])}


def value_at(path: str, now: dict):
    """The value now, of a path then."""
    head, dot, field = path.rpartition(".")
    if field in FLAGS:
        return now[f"{head}.status"] == FLAGS[field]
    return now.get(f"{head}{dot}{RENAMED.get(field, field)}", "missing")


@pytest.mark.parametrize("name", CONTENTS)
def test_a_file_of_an_earlier_version_is_read_equal_and_written_equal(name, tmp_path):
    found = load(unpacked(f"{name}.h5", tmp_path))
    assert differing(found, name) == {}
    save(found, tmp_path / "again.h5")
    assert differing(load(tmp_path / "again.h5"), name) == {}


@pytest.mark.parametrize("name", EXCHANGED)
def test_an_exchanged_file_of_an_earlier_version_is_read_equal(name, tmp_path):
    save(import_file(unpacked(f"{name}.mat", tmp_path)), tmp_path / "imported.h5")
    assert differing(load(tmp_path / "imported.h5"), name) == {}
