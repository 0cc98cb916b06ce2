import re
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording.conversion import continue_recording, finalise
from rig.recording.header import Column
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from tests.refused import refused
from tests.rig.recording.samples import COLUMNS, ROW, all_rows, fill, header, journal, rows

DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "file-format.md"


@pytest.fixture
def output(tmp_path):
    """A finished recording of one part that was interrupted."""
    path = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(path), header()) as writer:
        fill(writer, 0, 10_000, completed=False)
    finalise(journal_path(path), path)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_plain_h5py_reads_what_was_recorded(output):
    with h5py.File(output) as file:
        assert dict(file.attrs) | {"identity": ""} == {
            "format": "vibrolock",
            "schema": 3,
            "kind": "backbone",
            "software_version": "0.1.0",
            "started": "2031-05-01T12:00:00Z",
            "seed": 7,
            "identity": "",
        }
        part = file["parts/0"]
        for name in ROW.names:
            dataset = part["rows"][name]
            assert dataset[()].tobytes() == np.ascontiguousarray(rows(0, 10_000)[name]).tobytes()
            assert dataset.compression == "lzf"
            assert 1000 <= dataset.chunks[0] <= 20_000
        assert part["rows/inputs"].shape == (10_000, 4)
        assert part["rows/theta_rad"].attrs["unit"] == "rad"
        assert part["rows/theta_rad"].attrs["description"] == "phase of the oscillator"
        assert part["points/force_n"][()].tolist() == [0.0]
        assert part["points/settled"][()].tolist() == [True]
        assert part["points/periods"].dtype == np.int64
        assert part["events/what"].asstr()[()].tolist() == ["armed"]
        assert file["channels/unit"].asstr()[()].tolist() == ["N", "m/s²", "m/s²", "m/s²"]
        assert '"µ": 0.25' in file["configuration"].asstr()[()]


def patterns_of_the_document():
    text = DOCUMENT.read_text(encoding="utf-8")
    section = text[text.index("## HDF5 file of a recording") : text.index("## HDF5 file of a model")]
    listed = re.findall(r"^\| `([^`]+)` \| (group|JSON object|table|dataset) \|", section, re.M)
    assert len(listed) == 14
    return dict(listed)


def test_the_file_holds_exactly_the_paths_of_the_document(output):
    listed = patterns_of_the_document()
    kinds = {}
    with h5py.File(output) as file:
        file.visititems(lambda name, item: kinds.__setitem__("/" + name, "group" if "keys" in dir(item) else "dataset"))
    documented = {}
    for path, what in listed.items():
        pattern = path.replace("/N", "/[0-9]+").replace("FIELD", "[a-z_]+")
        documented[pattern] = {"JSON object": "dataset", "table": "group"}.get(what, what)
        if what == "table":
            documented[f"{pattern}/(json|[a-z_0-9]+)"] = "dataset"
    seen = set()
    for path, kind in kinds.items():
        matching = [p for p, what in documented.items() if re.fullmatch(p, path) and what == kind]
        assert matching, path
        seen.update(matching)
    ours = {pattern for pattern in documented if pattern.startswith("/") and pattern != "/"}
    assert seen == ours


def test_the_examples_of_the_document_run(output, monkeypatch):
    monkeypatch.chdir(output.parent)
    with JournalWriter.create("other.journal", header()):
        pass
    codes = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.S)
    for code in codes:
        exec(code, found := {})
        if "first_second" in found:
            assert found["first_second"].shape == (5000, 4)
            return
    pytest.fail("no example reads the first second")


def test_the_journal_and_the_file_made_of_it_say_the_same(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 1234)
    with Recording(path) as before:
        finalise(journal_path(path), path)
        with Recording(path) as after:
            for name in (
                "configuration",
                "channels",
                "kind",
                "seed",
                "software_version",
                "started",
                "points",
                "complete",
            ):
                assert getattr(before, name) == getattr(after, name), name
            one, other = before.parts[0], after.parts[0]
            for name in ("information", "events", "end", "n_rows", "row_dtype", "columns", "first_sample"):
                assert getattr(one, name) == getattr(other, name), name
            assert all_rows(one).tobytes() == all_rows(other).tobytes() == rows(0, 1234).tobytes()
    assert names(tmp_path) == ["OUT.h5"]


def test_a_resumed_file_is_read_with_its_journal_and_merged_at_the_end(output):
    old = output.read_bytes()
    with continue_recording(output) as writer:
        fill(writer, 10_000, 300, completed=None)
    with continue_recording(output) as writer:
        fill(writer, 10_300, 200)
    assert output.read_bytes() == old
    for _ in range(2):
        with Recording(output) as recording:
            assert [part.n_rows for part in recording.parts] == [10_000, 300, 200]
            assert [part.first_sample for part in recording.parts] == [0, 10_000, 10_300]
            assert [point["force_n"] for point in recording.points] == [0.0, 1000.0, 1030.0]
            assert recording.complete
            together = np.concatenate([all_rows(part) for part in recording.parts])
            assert together.tobytes() == rows(0, 10_500).tobytes()
        if journal_path(output).exists():
            finalise(journal_path(output), output)
    assert names(output.parent) == ["OUT.h5"]


def test_a_conversion_interrupted_before_the_journal_was_removed_is_done_again_without_doubling(output):
    with continue_recording(output) as writer:
        fill(writer, 10_000, 300)
    kept = journal_path(output).read_bytes()
    finalise(journal_path(output), output)
    journal_path(output).write_bytes(kept)
    for _ in range(2):
        with Recording(output) as recording:
            assert [part.n_rows for part in recording.parts] == [10_000, 300]
        if journal_path(output).exists():
            finalise(journal_path(output), output)


def test_rows_of_another_layout_open_a_part_of_their_own(output):
    with continue_recording(output) as writer:
        fill(writer, 10_000, 300, completed=False)
    other = np.dtype([("sample", "<u4"), ("new", "<f4", (2, 3))])
    columns = [COLUMNS[0], Column("new", "m", "something new")]
    with continue_recording(output, row_dtype=other, columns=columns) as writer:
        assert writer.header.first_part == 2
        writer.part({})
        writer.rows(np.ones(5, other))
    finalise(journal_path(output), output)
    with Recording(output) as recording:
        assert [part.row_dtype for part in recording.parts] == [ROW, ROW, other]
        assert recording.parts[2].rows("new").shape == (5, 2, 3)


def test_an_empty_journal_left_by_a_kill_at_the_first_moment_does_not_matter(output):
    journal_path(output).touch()
    with Recording(output) as recording:
        assert recording.n_rows == 10_000
    with continue_recording(output) as writer:
        assert writer.header.first_part == 1


def test_a_journal_never_joins_a_file_of_another_recording(output):
    before = output.read_bytes()
    journal(journal_path(output), 10)
    for use in (Recording, continue_recording, lambda path: finalise(journal_path(path), path)):
        with refused(RecordingError, "is-another-recording-than-the-journal"):
            use(output)
    assert output.read_bytes() == before


def test_a_continuing_journal_wants_its_file(output):
    with continue_recording(output) as writer:
        fill(writer, 10_000, 3)
    output.unlink()
    with refused(RecordingError, "missing-but-its-journal-continues-it"):
        Recording(output)


def test_a_continuing_journal_refuses_an_older_copy_of_its_file(output):
    older = output.read_bytes()
    with continue_recording(output) as writer:
        fill(writer, 10_000, 3)
    finalise(journal_path(output), output)
    with continue_recording(output) as writer:
        fill(writer, 10_003, 3)
    output.write_bytes(older)
    with refused(RecordingError, "holds-parts-but-its-journal-continues"):
        finalise(journal_path(output), output)


def test_what_was_torn_off_is_told_in_the_file(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 1000)
    journal_path(path).write_bytes(journal_path(path).read_bytes()[:-5])
    finalise(journal_path(path), path)
    with Recording(path) as recording:
        assert not recording.complete
        assert recording.parts[0].dropped_bytes > 0
        assert "the file ends within a block" in recording.parts[0].dropped_reason
    assert names(tmp_path) == ["OUT.h5"]


def test_a_journal_with_damage_amid_whole_blocks_is_kept_aside(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 1000)
    data = bytearray(journal_path(path).read_bytes())
    data[len(data) // 2] ^= 1
    journal_path(path).write_bytes(data)
    finalise(journal_path(path), path)
    assert names(tmp_path) == ["OUT.h5", "OUT.h5.journal.damaged"]
    assert (tmp_path / "OUT.h5.journal.damaged").read_bytes() == data


def test_a_journal_without_parts_makes_no_file(tmp_path):
    path = tmp_path / "OUT.h5"
    JournalWriter.create(journal_path(path), header()).close()
    with refused(RecordingError, "nothing-was-recorded"):
        finalise(journal_path(path), path)
    assert names(tmp_path) == ["OUT.h5.journal"]


def test_a_part_without_rows_points_and_events_is_stored(tmp_path):
    path = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(path), header(channels=[], seed=None, configuration={})) as writer:
        writer.part({})
    finalise(journal_path(path), path)
    with Recording(path) as recording:
        (part,) = recording.parts
        assert (part.n_rows, part.points, part.events, part.end, part.first_sample) == (0, [], [], None, None)
        assert part.rows("inputs").shape == (0, 4)
        assert (recording.seed, recording.channels, recording.configuration) == (None, [], {})


def test_awkward_points_are_kept_whole_and_make_only_plain_columns(tmp_path):
    points = [
        {"a": 1, "b": 1.5, "c": True, "d": "x", "json": 1, "a/b": 2, "big": 2**80, "n": None, "bad\0": 1, "t": "a\0b"},
        {"a": 2.5, "c": False, "d": None, "e": [1, 2], "big": 1, "mixed": "x"},
        {"a": float("inf"), "b": None, "c": True, "mixed": 3, "late": 5},
    ]
    path = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(path), header()) as writer:
        writer.part({})
        for point in points:
            writer.point(point)
    finalise(journal_path(path), path)
    with Recording(path) as recording:
        assert recording.parts[0].points == points
    with h5py.File(path) as file:
        group = file["parts/0/points"]
        assert sorted(group) == ["a", "b", "c", "d", "json", "late"]
        np.testing.assert_array_equal(group["a"][()], [1, 2.5, np.inf])
        np.testing.assert_array_equal(group["b"][()], [1.5, np.nan, np.nan])
        np.testing.assert_array_equal(group["late"][()], [np.nan, np.nan, 5])
        assert group["c"][()].tolist() == [True, False, True]
        assert group["d"].asstr()[()].tolist() == ["x", "", ""]


def test_a_configuration_of_a_megabyte_is_stored(tmp_path):
    path, long = tmp_path / "OUT.h5", {"waveform_v": np.sin(np.arange(50_000)).tolist()}
    journal(journal_path(path), 10, configuration=long)
    finalise(journal_path(path), path)
    with Recording(path) as recording:
        assert recording.configuration == long


def test_a_conversion_takes_little_memory(tmp_path):
    path, piece = tmp_path / "OUT.h5", rows(0, 20_000)
    with JournalWriter.create(journal_path(path), header()) as writer:
        writer.part({})
        for _ in range(50):
            writer.rows(piece)
    tracemalloc.start()
    try:
        finalise(journal_path(path), path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8e6


def test_noise_is_stored_as_it_is_and_what_shrinks_is_compressed(tmp_path):
    values = rows(0, 40_000)
    values["inputs"] = np.random.default_rng(0).standard_normal(values["inputs"].shape)
    path = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(path), header()) as writer:
        writer.part({"first_sample": 0})
        writer.rows(values)
        writer.end({"completed": True})
    finalise(journal_path(path), path)
    with h5py.File(path) as file:
        stored = file["parts/0/rows"]
        assert stored["inputs"].compression is None
        assert {stored[name].compression for name in stored if stored[name].dtype.kind in "iu"} == {"lzf"}
        assert stored["inputs"].id.get_storage_size() >= values["inputs"].nbytes
        for name in ROW.names:  # the last chunk is not full
            assert stored[name][()].tobytes() == np.ascontiguousarray(values[name]).tobytes()
    with Recording(path) as recording:
        assert recording.integrity == "verified"
        assert recording.parts[0].read(39_000, 40_000).tobytes() == values[39_000:].tobytes()
