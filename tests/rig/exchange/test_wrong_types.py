"""A file that does not hold what makes its kind of model is refused in one line, whatever is missing or wrong in it."""

import json

import numpy as np
import pytest

from rig.cli.options import show_file
from rig.errors import RecordingError
from rig.figures.files import plot
from rig.recording.arrays import read_arrays, write_arrays
from rig.results.files import load, save
from tests.refused import refused

WRONG_ARRAYS = {
    "text": lambda values: np.full(values.shape, "x"),
    "a number": lambda values: np.float64(3.0),
    "one too few": lambda values: values.reshape(-1)[:-1],
    "empty": lambda values: np.zeros(0),
    "one axis more": lambda values: values[..., None],
    "complex": lambda values: np.ones(values.shape, complex) if values.dtype.kind != "U" else np.zeros(values.shape),
    "infinite": lambda values: np.full(values.shape, np.inf),
}
WRONG_ATTRIBUTES = (None, "text", 3, [], {}, [1, "a"])


@pytest.fixture(params=["mode", "modes", "matrix", "responses", "backbone"])
def stored(request, tmp_path):
    save(request.getfixturevalue(request.param), tmp_path / "good.h5")
    return read_arrays(tmp_path / "good.h5")


def variants(stored):
    _kind, arrays, attributes = stored
    for name in arrays:
        yield {key: values for key, values in arrays.items() if key != name}, attributes
        for wrong in WRONG_ARRAYS.values():
            yield {**arrays, name: wrong(arrays[name])}, attributes
    for path in paths(attributes):
        for wrong in WRONG_ATTRIBUTES:
            yield arrays, changed(attributes, path, wrong)


def paths(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from paths(item, (*path, key))


def changed(attributes, path, wrong):
    out = json.loads(json.dumps(attributes))
    inner = out
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = wrong
    return out


def test_whatever_is_wrong_in_a_model_showing_it_works_or_says_so_in_one_line(stored, tmp_path, monkeypatch, capsys):
    path = tmp_path / "wrong.h5"
    refused = 0
    for arrays, attributes in variants(stored):
        monkeypatch.setattr("rig.results.files.read_arrays", lambda _, a=arrays, b=attributes: (stored[0], a, b))
        monkeypatch.setattr("rig.show.summary.kind_of", lambda _: stored[0])
        monkeypatch.setattr("rig.show.summary.file_integrity", lambda _: "verified")
        with np.errstate(all="ignore"):
            try:
                show_file(path, json=False)
            except RecordingError as error:
                refused += 1
                line = str(error)
                assert line.startswith(f"{path}: does not hold what makes a {stored[0]} (")
                assert "\n" not in line
    assert refused > 10


@pytest.mark.parametrize("use", [load, lambda path: plot(path, path.with_suffix(".png"))])
def test_text_in_the_place_of_numbers_is_refused_wherever_a_model_is_used(modes, tmp_path, use):
    path = tmp_path / "wrong.h5"
    save(modes, path)
    kind, arrays, attributes = read_arrays(path)
    write_arrays(path, kind, {**arrays, "modes/shapes": np.full((3, 3), "x")}, attributes)
    with refused(RecordingError, "wrong-does-not-hold-what-makes"):
        use(path)
