"""Every HDF5 file carries a digest; what has none is read by a child process first, and is called unverified."""

import hashlib
import os
import struct

import h5py
import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording import integrity
from rig.recording.arrays import read_arrays, write_arrays
from rig.recording.conversion import continue_recording, finalise
from rig.recording.journal import journal_path
from rig.recording.layout import file_integrity
from rig.recording.reader import Recording
from rig.show.summary import summarise
from rig.show.tables import print_summary
from rig.system.child import ChildFailed
from tests.refused import refused
from tests.rig.recording.samples import fill, journal, without_digest

GONE = "unverified: its digest is gone; another program has changed or rewritten it, or cut off its end"


@pytest.fixture
def output(tmp_path):
    path = tmp_path / "OUT.h5"
    journal(journal_path(path), 3000)
    finalise(journal_path(path), path)
    return path


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "MODEL.h5"
    write_arrays(path, "nonlinear-mode", {"x": np.arange(20_000.0), "group/y": [1, 2]}, {"notes": ["one"]})
    return path


def no_child(monkeypatch):
    def refuse(*_args, **_kwargs):
        raise AssertionError("a child was started")

    monkeypatch.setattr(integrity, "ask_child", refuse)


def test_a_file_ends_with_the_digest_of_all_before_it_and_needs_no_child(output, model, monkeypatch):
    no_child(monkeypatch)
    for path in (output, model):
        data = path.read_bytes()
        magic, version, digest, covered = struct.unpack("<8sI32sQ", data[-52:])
        assert (magic, version, covered) == (b"VLDIGEST", 1, len(data) - 52)
        assert digest == hashlib.sha256(data[:covered]).digest()
        assert file_integrity(path) == "verified"
    with Recording(output) as recording:
        assert recording.integrity == "verified"


def test_hdf5_ignores_the_digest(model):
    with h5py.File(model) as file:
        assert file["arrays/x"][-1] == 19_999.0


@pytest.mark.parametrize(
    "change",
    [
        lambda file: None,
        lambda file: file.attrs.__setitem__("note", "seen by Ada"),
        lambda file: file.__setitem__("note", "seen by Ada"),
        lambda file: file["arrays/x"].__setitem__(3, 7.0),
    ],
)
def test_a_file_that_was_opened_for_writing_elsewhere_is_read_and_called_unverified(model, change):
    with h5py.File(model, "r+") as file:
        change(file)
    assert file_integrity(model) == GONE
    assert read_arrays(model)[1]["group/y"].tolist() == [1, 2]


def test_a_file_that_another_program_has_rewritten_is_called_unverified(model, tmp_path):
    copy = tmp_path / "copy.h5"
    with h5py.File(model) as old, h5py.File(copy, "w") as new:
        new.attrs.update(old.attrs)
        for name in old:
            old.copy(name, new)
    assert file_integrity(copy) == GONE


def test_a_file_of_an_earlier_schema_is_unverified_because_it_had_no_digest(output, monkeypatch):
    with h5py.File(output, "r+") as file:
        file.attrs["schema"] = 2
    with Recording(output) as recording:
        assert recording.integrity == "unverified: written by schema 2, which has no digest"


@pytest.mark.parametrize("lost", [1, 30, 51])
def test_a_file_that_has_lost_a_part_of_its_digest_is_not_taken_for_verified(output, lost):
    output.write_bytes(output.read_bytes()[:-lost])
    assert file_integrity(output) == GONE


@pytest.mark.parametrize("place", range(-52, 0))
def test_a_changed_byte_in_the_digest_itself_is_damage(model, place):
    data = bytearray(model.read_bytes())
    data[place] ^= 1
    model.write_bytes(data)
    with refused(RecordingError, "its-digest-does-not-match"):
        read_arrays(model)


def test_a_crash_of_the_hdf5_library_is_one_line(model, monkeypatch):
    without_digest(model)

    def crash(*_args, **_kwargs):
        raise ChildFailed("crashed (SIGSEGV)")

    monkeypatch.setattr(integrity, "ask_child", crash)
    with refused(RecordingError, "damaged-the-library-crashed-over-it"):
        read_arrays(model)


def test_what_was_found_is_remembered_until_the_file_changes(model, monkeypatch):
    without_digest(model)
    os.utime(model, (1.0, 1.0))
    monkeypatch.setattr(integrity, "_SETTLED_S", -1.0)
    assert file_integrity(model) == GONE
    no_child(monkeypatch)
    assert file_integrity(model) == GONE
    os.utime(model, (2.0, 2.0))
    with refused(AssertionError, "a-child-was-started"):
        file_integrity(model)


def test_show_says_of_an_unverified_model_that_it_is(tmp_path, capsys, shown_model):
    assert summarise(shown_model)["integrity"] == "verified"
    print_summary(summarise(shown_model))
    assert "verified" not in capsys.readouterr().out
    without_digest(shown_model)
    summary = summarise(shown_model)
    assert summary["integrity"] == GONE
    print_summary(summary)
    assert GONE in capsys.readouterr().out.splitlines()


def test_parts_taken_over_from_an_unverified_file_stay_unverified(output):
    without_digest(output)
    for _ in range(2):
        with continue_recording(output) as writer:
            fill(writer, 3000, 100)
        finalise(journal_path(output), output)
        assert file_integrity(output) == "verified"
        told = f"unverified: taken over from an unverified file: parts 0 to 0: {GONE.removeprefix('unverified: ')}"
        with Recording(output) as recording:
            assert recording.integrity == told


def test_a_recording_whose_json_lacks_what_is_shown_is_refused_in_one_line(tmp_path):
    output = tmp_path / "OUT.h5"
    journal(journal_path(output), 100, configuration={"plan": {}})
    with refused(RecordingError, "does-not-hold-what-makes-recording"):
        summarise(output)


@pytest.fixture
def shown_model(tmp_path):
    from identification import FrequencyResponse
    from rig.results.files import save

    path = tmp_path / "SHOWN.h5"
    hz = np.array([23.0, 24.0, 25.0])
    save((FrequencyResponse(hz, np.ones(3), 1j * np.ones(3), "acceleration", "force", 0.5, "0.5 N", "beam"),), path)
    return path
