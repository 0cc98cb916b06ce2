"""What a run that was to overwrite a recording leaves when it is killed, and what the next run makes of it."""

import pytest

import rig
from rig.campaigns.running.output_file import prepare_output, restore_backup
from rig.errors import RecordingError
from rig.recording.conversion import finalise
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from tests.refused import refused
from tests.rig.recording.samples import fill, header, journal


@pytest.fixture
def killed(tmp_path):
    """A good recording as an overwriting run leaves it that is killed before it has begun."""
    output = tmp_path / "OUT.h5"
    journal(journal_path(output), 300)
    finalise(journal_path(output), output)
    good = output.read_bytes()
    output.rename(tmp_path / "OUT.h5.vibrolock-before")
    return output, good


@pytest.mark.parametrize("begun", [False, True])
def test_a_recording_that_was_moved_out_of_the_way_comes_back(killed, begun):
    output, good = killed
    if begun:
        JournalWriter.create(journal_path(output), header()).close()
    assert "is back under its name" in restore_backup(output)
    assert output.read_bytes() == good
    assert sorted(path.name for path in output.parent.iterdir()) == ["OUT.h5"]
    assert restore_backup(output) == ""


def test_a_journal_with_rows_has_taken_its_place_and_the_old_recording_goes_when_that_is_whole(killed):
    output, _ = killed
    with JournalWriter.create(journal_path(output), header(identity="another")) as writer:
        fill(writer, 0, 50)
    assert restore_backup(output) == ""
    with Recording(output) as recording:
        assert recording.n_rows == 50
    assert (output.parent / "OUT.h5.vibrolock-before").exists()


def test_the_next_run_and_the_next_resumption_put_it_back_and_say_so(killed, monkeypatch):
    output, good = killed
    told = []

    class Listening:
        def remark(self, text):
            told.append(text)

    with refused(RecordingError, "exists-already"):
        rig.run("magnet-beam/backbone-short", output=output, progress=Listening())
    assert output.read_bytes() == good
    assert len(told) == 1


def test_a_name_that_no_file_can_have_is_refused_in_one_line(tmp_path):
    with refused(RecordingError, "cannot-be-used-file-name-too"):
        prepare_output(tmp_path / ("a" * 300 + ".h5"), overwrite=False)
