"""HDF5 files with a digest that matches, holding what no file of ours holds: refused in one line, before it is read."""

import re
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording import examination, tables
from rig.recording.arrays import kind_of, read_arrays, write_arrays
from rig.recording.conversion import finalise
from rig.recording.integrity import append_trailer
from rig.recording.journal import journal_path
from rig.recording.layout import identify, new_file
from rig.recording.reader import Recording
from tests.refused import refused
from tests.rig.recording.samples import journal


def sealed(path: Path) -> Path:
    """The file with a digest that matches, which anyone can write."""
    with path.open("r+b") as stream:
        append_trailer(stream)
    return path


def external_link(file):
    file["arrays/b"] = h5py.ExternalLink("other.h5", "/secret")


def soft_link(file):
    file["arrays/b"] = h5py.SoftLink("/attributes")


def second_name(file):
    file["arrays/b"] = file["arrays/a"]


def endless_group(file):
    file["arrays/b"] = file["/"]


def virtual_dataset(file):
    layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "secret", shape=(4,))
    file.create_virtual_dataset("arrays/b", layout)


def external_storage(file):
    file.create_dataset("arrays/b", shape=(16,), dtype="u1", external=[("/etc/passwd", 0, 16)])


def named_type(file):
    file["arrays/b"] = np.dtype("f8")


def references(file):
    file.create_dataset("arrays/b", data=[file["arrays"].ref], dtype=h5py.ref_dtype)


def compound(file):
    file["arrays/b"] = np.zeros(3, [("x", "f8"), ("y", "i4")])


def empty_space(file):
    file.create_dataset("arrays/b", shape=(20_000_000_000,), dtype="f4", chunks=(16384,))


def nothing_stored(file):
    file.create_dataset("arrays/b", shape=(1_000_000,), dtype="f8")


def bomb(file):
    file.create_dataset("arrays/b", data=np.zeros(20_000_000), chunks=(2_000_000,), compression="gzip")


def large_chunk(file):
    file.create_dataset("arrays/b", shape=(10,), maxshape=(None,), dtype="f8", chunks=(2**26,), compression="gzip")


def many_texts(file):
    file.create_dataset("arrays/b", shape=(100_000,), dtype=h5py.string_dtype())


@pytest.mark.parametrize(
    ("hostile", "message"),
    [
        (external_link, "/arrays/b is a link to elsewhere"),
        (soft_link, "/arrays/b is a link to elsewhere"),
        (second_name, "/arrays/b is another name of an object"),
        (endless_group, "/arrays/b is another name of an object"),
        (virtual_dataset, "/arrays/b keeps its values in another file"),
        (external_storage, "/arrays/b keeps its values in another file"),
        (named_type, "/arrays/b is a Datatype; allowed are groups and datasets"),
        (references, "/arrays/b holds lists or references"),
        (compound, "numbers or texts are expected"),
        (empty_space, "/arrays/b declares 1220704 chunks and stores 0"),
        (nothing_stored, "/arrays/b declares 8000000 bytes and stores 0"),
        (bomb, "its datasets declare .* bytes in a file of .*; allowed are 200 times its size"),
        (large_chunk, "/arrays/b has chunks of .*; allowed are 268435456 bytes"),
        (many_texts, "its datasets declare .* texts"),
    ],
)
@pytest.mark.parametrize("digest", [True, False])
def test_what_only_a_hostile_file_holds_is_refused_before_it_is_read(tmp_path, hostile, message, digest):
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", {"a": [1.0]}, {})
    with h5py.File(path, "r+") as file:
        hostile(file)
    if digest:
        sealed(path)
    tracemalloc.start()
    try:
        for use in (read_arrays, kind_of):
            with refused(RecordingError, reason=lambda text: re.search(message, text)) as caught:
                use(path)
            assert "\n" not in str(caught.value)
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_inputs_that_lie_in_a_file_of_the_system_are_refused(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 100)
    finalise(journal_path(path), path)
    with h5py.File(path, "r+") as file:
        group = file["parts/0/rows"]
        del group["inputs"]
        group.create_dataset("inputs", shape=(100, 4), dtype="<f4", external=[("/etc/passwd", 0, 1600)])
    with refused(RecordingError, "parts-rows-inputs-keeps-its-values"):
        Recording(sealed(path))


def test_more_rows_than_are_stored_are_refused(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 100)
    finalise(journal_path(path), path)
    with h5py.File(path, "r+") as file:
        part = file["parts/0"]
        part.attrs["n_rows"] = 20_000_000_000
        for name, values in list(part["rows"].items()):
            shape, dtype = (20_000_000_000, *values.shape[1:]), values.dtype
            del part["rows"][name]
            part["rows"].create_dataset(name, shape, dtype, chunks=(1000, *shape[1:]))
    with refused(RecordingError, "parts-rows-declares-chunks-and-stores"):
        Recording(sealed(path))


def test_too_many_objects_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(examination, "MOST_OBJECTS", 3)
    write_arrays(tmp_path / "MODEL.h5", "nonlinear-mode", {"a": [1.0], "b": [1.0]}, {})
    with refused(RecordingError, "holds-more-than-groups-and-datasets"):
        read_arrays(tmp_path / "MODEL.h5")


def test_a_file_is_examined_again_once_it_has_changed_and_while_its_times_may_not_tell(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(examination, "examine", lambda file, size: seen.append(size))
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", {"a": [1.0]}, {})
    monkeypatch.setattr(examination, "_SETTLED_S", 1e6)
    for _ in range(2):
        kind_of(path)
    assert len(seen) == 2  # just written: a change within a tick of the clock would not be seen
    monkeypatch.setattr(examination, "_SETTLED_S", -1e6)
    for _ in range(3):
        kind_of(path)
    assert len(seen) == 3
    write_arrays(path, "nonlinear-mode", {"a": [2.0]}, {})
    kind_of(path)
    assert len(seen) == 4


def test_attributes_that_are_too_large_are_refused(tmp_path, monkeypatch):
    with new_file(tmp_path / "MODEL.h5", kept="") as (file, _):
        identify(file, "k" * 10)
        file.attrs["format"] = np.zeros(7000)
    monkeypatch.setattr(examination, "_LARGEST_ATTRIBUTE_BYTES", 50_000)
    with refused(RecordingError, "its-attribute-format-is-longer-than"):
        kind_of(tmp_path / "MODEL.h5")


def with_texts(path, texts):
    write_arrays(path, "nonlinear-mode", {}, {})
    with h5py.File(path, "r+") as file:
        del file["attributes"]
        file.create_dataset("attributes", data=texts[0], dtype=h5py.string_dtype())
        file.create_dataset("arrays/names", data=texts[1:] or [""], dtype=h5py.string_dtype())
    return sealed(path)


def test_a_json_text_that_is_too_long_is_refused(tmp_path):
    path = with_texts(tmp_path / "MODEL.h5", ['{"a": "' + "x" * tables.LARGEST_TEXT_BYTES + '"}'])
    with refused(RecordingError, "damaged-attributes-its-texts-are-too"):
        read_arrays(path)


def test_texts_that_are_too_long_together_are_refused_and_one_text_for_many_does_not_fill_the_memory(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(tables, "LARGEST_TEXTS_BYTES", 2**22)
    path = with_texts(tmp_path / "MODEL.h5", ["{}", *["x" * 2**20] * 6])
    with refused(RecordingError, "arrays-names-its-texts-are-too"):
        read_arrays(path)


def test_what_is_too_long_to_be_read_is_not_written(tmp_path):
    with refused(RecordingError, "attributes-bytes-of-allowed-are"):
        write_arrays(tmp_path / "MODEL.h5", "nonlinear-mode", {}, {"a": "x" * tables.LARGEST_TEXT_BYTES})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("value", [3.0, np.arange(3.0)])
def test_numbers_where_json_belongs_are_one_line(tmp_path, value):
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", {}, {})
    with h5py.File(path, "r+") as file:
        del file["attributes"]
        file["attributes"] = value
    with refused(RecordingError, "texts-are-wanted", field="/attributes"):
        read_arrays(sealed(path))
