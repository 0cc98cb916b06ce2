import errno
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from rig.errors import RecordingError
from rig.recording.arrays import kind_of, read_arrays, write_arrays
from rig.recording.conversion import continue_recording, finalise
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from tests.refused import refused
from tests.rig.recording.samples import header, journal, without_digest


@pytest.fixture
def output(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 3000)
    finalise(journal_path(path), path)
    return path


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", {"says": "not-file-of-vibrolock-but-an"}),
        (b"time;force\n0;1\n", {"says": "but-text-file"}),
        (b"MATLAB 5.0 MAT-file, Platform: PCWIN64", {"says": "but-file"}),
        (b"VLJB\x01\x00", {"says": "but-journal-give-the-name-of"}),
        (bytes(range(256)), {"says": "but-no-file"}),
    ],
)
def test_what_is_no_hdf5_file_is_called_what_it_is(tmp_path, content, message):
    path = tmp_path / "OUT.h5"
    path.write_bytes(content)
    for use in (Recording, kind_of, read_arrays, continue_recording):
        with refused(RecordingError, **message):
            use(path)
    assert path.read_bytes() == content


def test_a_missing_file_is_named(tmp_path):
    for use in (Recording, kind_of, read_arrays):
        with refused(RecordingError, "cannot-be-read-no-such-file"):
            use(tmp_path / "OUT.h5")
    with refused(RecordingError, "neither-the-file-nor-its-journal"):
        continue_recording(tmp_path / "OUT.h5")
    with refused(RecordingError, "cannot-be-read"):
        finalise(tmp_path / "OUT.h5.journal", tmp_path / "OUT.h5")
    assert not list(tmp_path.iterdir())


def test_a_folder_is_no_recording(tmp_path):
    with refused(RecordingError, "cannot-be-read"):
        Recording(tmp_path)


def test_a_file_without_permission_is_named(output, monkeypatch):
    def no_permission(*_args, **_kwargs):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "open", no_permission)
    with refused(RecordingError, "cannot-be-read-permission-denied"):
        Recording(output)


def test_an_hdf5_file_of_another_program_is_refused(tmp_path):
    with h5py.File(tmp_path / "OUT.h5", "w") as file:
        file["x"] = 1
    with refused(RecordingError, "an-file-of-another-program"):
        Recording(tmp_path / "OUT.h5")


@pytest.mark.parametrize(
    ("schema", "message"),
    [(4, {"says": "written-by-schema-this-version-reads"}), ("x", {"says": "damaged-schema"})],
)
def test_a_later_or_impossible_schema_is_refused(output, schema, message):
    with h5py.File(output, "r+") as file:
        file.attrs["schema"] = schema
    for use in (Recording, kind_of):
        with refused(RecordingError, **message):
            use(output)


@pytest.mark.parametrize("fraction", [0.05, 0.5, 0.99])
def test_a_truncated_file_is_called_truncated(output, fraction):
    data = output.read_bytes()
    output.write_bytes(data[: int(len(data) * fraction)])
    with refused(RecordingError, "truncated"):
        Recording(output)


@pytest.mark.parametrize(
    "lost", ["configuration", "parts/0/columns", "parts/0/rows/inputs", "parts/0/points/json", "channels"]
)
def test_a_file_that_lacks_something_is_called_damaged(output, lost):
    with h5py.File(output, "r+") as file:
        del file[lost]
    with refused(RecordingError, "damaged"):
        Recording(output)


def test_a_flipped_bit_in_rows_without_a_digest_is_noticed_by_their_checksum(output):
    without_digest(output)
    with h5py.File(output) as file:
        chunk = file["parts/0/rows/inputs"].id.get_chunk_info(0)
    data = bytearray(output.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 4
    output.write_bytes(data)
    with refused(RecordingError, "damaged-cannot-be-read"):
        Recording(output)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0, 1, exclude_max=True), value=st.integers(1, 255))
def test_a_changed_byte_anywhere_in_the_file_is_refused_in_one_clear_line(output, where, value):
    broken = bytearray(output.read_bytes())
    broken[int(where * len(broken))] ^= value
    path = output.with_name("broken.h5")
    path.write_bytes(broken)
    with pytest.raises(RecordingError) as caught:
        Recording(path)
    line = str(caught.value)
    assert line == f"{path}: damaged: its digest does not match (a byte has changed since it was written)" or line == (
        f"{path}: not a file of vibrolock, but no HDF5 file"
    )


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0, 1, exclude_max=True), value=st.integers(1, 255))
def test_without_a_digest_a_changed_byte_gives_one_clear_line_or_a_readable_recording(output, where, value):
    path, message, n_read = output.with_name("broken.h5"), "", 0
    shutil.copy(output, path)
    without_digest(path)
    broken = bytearray(path.read_bytes())
    broken[int(where * len(broken))] ^= value
    path.write_bytes(broken)
    try:
        with Recording(path) as recording:
            assert recording.integrity.startswith("unverified: ")
            n_read = sum(len(recording.parts[0].rows(name)) for name in recording.parts[0].row_dtype.names)
    except RecordingError as error:
        message = str(error)
    assert n_read == 5 * 3000 or message.startswith(f"{path}: ")
    assert "\n" not in message


def test_an_unknown_field_is_answered_with_those_there_are(output):
    with (
        Recording(output) as recording,
        refused(RecordingError, "no-field-force-theta-rad-frequency"),
    ):
        recording.parts[0].rows("force")


def test_a_closed_recording_says_so(output):
    recording = Recording(output)
    recording.close()
    recording.close()
    with refused(RecordingError, "is-closed"):
        recording.parts[0].rows("inputs")


def test_reading_leaves_nothing_behind(tmp_path):
    path = tmp_path / "OUT.h5"
    before = journal(journal_path(path), 10).read_bytes()
    with Recording(path) as recording:
        assert recording.complete
    assert kind_of(path) == "backbone"
    assert [p.name for p in tmp_path.iterdir()] == ["OUT.h5.journal"]
    assert journal_path(path).read_bytes() == before


def test_arrays_and_attributes_come_back_as_they_were(tmp_path):
    arrays = {
        "force_n": np.linspace(0.026, 0.56, 12),
        "modes/shape": np.arange(6).reshape(2, 3) * (1 + 2j),
        "modes/names": np.array(["clamp", "µ-tip", ""]),
        "valid": np.array([True, False]),
        "scalar": np.float32(3.5),
        "empty": np.zeros((0, 3)),
        "nothing_named": np.array([], dtype=str),
        "large": np.random.default_rng(0).normal(size=(100, 200)),
    }
    attributes = {"specimen": "magnet-beam", "rule": {"periods": 20}, "nan": None}
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", arrays, attributes)
    kind, found, told = read_arrays(path)
    assert (kind, told) == ("nonlinear-mode", attributes)
    assert kind_of(path) == "nonlinear-mode"
    assert set(found) == set(arrays)
    for name, values in arrays.items():
        assert found[name].dtype.kind == values.dtype.kind, name
        np.testing.assert_array_equal(found[name], values)
        assert found[name].shape == values.shape
    with h5py.File(path) as file:
        assert (file.attrs["format"], file.attrs["schema"]) == ("vibrolock", 3)
        assert file["arrays/force_n"][-1] == 0.56


@pytest.mark.parametrize(
    ("arrays", "attributes", "message"),
    [
        ({"a b": [1]}, {}, {"says": "array-name-2"}),
        ({"../x": [1]}, {}, {"says": "array-name"}),
        ({"x": np.array([object()])}, {}, {"says": "array-is-object"}),
        ({"x": [[1, 2], [3]]}, {}, {"says": "unequal-length"}),
        ({"x": [1], "x/y": [2]}, {}, {"says": "array-name-is-also-the-group"}),
        ({"x": [1]}, {"a": {1, 2}}, {"says": "attributes-cannot-be-written-as"}),
    ],
)
def test_arrays_that_cannot_be_stored_leave_the_old_file(tmp_path, arrays, attributes, message):
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", {"x": [1.0]}, {})
    before = path.read_bytes()
    with refused(RecordingError, **message):
        write_arrays(path, "nonlinear-mode", arrays, attributes)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["MODEL.h5"]


def test_a_model_is_no_recording_and_a_recording_no_model(tmp_path, output):
    model = tmp_path / "MODEL.h5"
    write_arrays(model, "nonlinear-mode", {}, {})
    with refused(RecordingError, "is-no-recording-but-file-of"):
        Recording(model)
    with refused(RecordingError, "holds-no-arrays-it-is-recording"):
        read_arrays(output)


def test_a_folder_that_does_not_exist_is_told(tmp_path):
    with refused(RecordingError, "cannot-be-written-no-such-file"):
        write_arrays(tmp_path / "missing" / "MODEL.h5", "nonlinear-mode", {}, {})


def test_points_that_count_follow_the_plan_in_force_and_earlier_results_give_way_to_later_ones(tmp_path):
    path = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(path), header()) as writer:
        writer.part({"first_sample": 0})
        for number in (0, 1, 2):
            writer.point({"number": number, "told": "first"})
        writer.part({"first_sample": 0, "plan": {"levels_n": [0.56, 0.1]}, "numbers": [3, 1]})
        writer.point({"number": 3, "told": "second"})
        writer.part({"first_sample": 0})
        writer.point({"number": 1, "told": "third"})
    with Recording(path) as before:
        told = [(number, point["told"], point["part"]) for number, point in before.latest.items()]
        assert told == [(3, "second", 1), (1, "third", 2)]
        assert list(before.former) == [0, 2]
        assert before.configuration["plan"] == {"levels_n": [0.56, 0.1]}
        assert before.configuration["bench"] == header().configuration["bench"]
        assert [plan.part for plan in before.plans] == [0, 1]
        points = before.points
    finalise(journal_path(path), path)
    with Recording(path) as after:
        assert after.points == points
        assert after.latest == {3: points[3], 1: points[4]}
        assert [plan.plan for plan in after.plans] == [header().configuration["plan"], {"levels_n": [0.56, 0.1]}]


def test_a_journal_of_0_bytes_is_said_to_be_of_a_run_that_never_began(tmp_path, command):
    (tmp_path / "OUT.h5.journal").touch()
    for typed in (
        "show OUT.h5",
        "plot OUT.h5 -o x.png",
        "resume OUT.h5",
        "report OUT.h5 -o x.html",
        "export OUT.h5 -o x.mat",
    ):
        assert "OUT.h5.journal: is empty" in command(typed).err
