import errno
import os
import random
import struct
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording.conversion import finalise
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.journal_contents import JournalContents
from rig.recording.reader import Recording
from tests.forking import FORKED
from tests.refused import refused
from tests.rig.recording.samples import ROW, all_rows, fill, header, journal, rows

ROOT = Path(__file__).parents[3]
posix = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL and no limit of the file size on Windows")


def write_until_killed(path, first, seed, chance):
    """Returns the number of rows that the killed process had reported as written."""
    command = [sys.executable, "-m", "tests.rig.recording.writer_process", str(path), str(first), str(seed)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT) as process:
        reported = process.stdout.read(8)
        assert len(reported) == 8, "the writer did not start"
        time.sleep(chance.uniform(0.0, 0.02))
        process.kill()
        reported += process.stdout.read()
    return struct.unpack_from("<q", reported, len(reported) // 8 * 8 - 8)[0]


@posix
def test_no_row_whose_write_returned_is_lost_by_killing_the_writer_again_and_again(tmp_path):
    output, chance, first = tmp_path / "OUT.h5", random.Random(1), 0
    for seed in range(6):
        reported = write_until_killed(journal_path(output), first, seed, chance)
        with Recording(output) as recording:
            assert recording.parts[-1].first_sample == first
            assert recording.n_rows >= reported
            assert not recording.complete
            first = recording.n_rows
    assert first > 0
    with JournalWriter.reopen(journal_path(output)) as writer:
        fill(writer, first, 500)
    finalise(journal_path(output), output)
    with Recording(output) as recording:
        assert recording.complete
        assert len(recording.parts) == 7
        together = np.concatenate([all_rows(part) for part in recording.parts])
        assert together.tobytes() == rows(0, first + 500).tobytes()
    assert [path.name for path in tmp_path.iterdir()] == ["OUT.h5"]


FULL_DISK = """
import resource, signal, sys
sys.dont_write_bytecode = True  # which a full disk cuts short
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from rig.errors import RecordingError
def limit(n): resource.setrlimit(resource.RLIMIT_FSIZE, (n, resource.RLIM_INFINITY))
def lift(): resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""


def run(code, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", FORKED + FULL_DISK + code, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@posix
def test_on_a_full_disk_the_journal_keeps_all_whole_blocks_and_goes_on_when_there_is_room(tmp_path):
    code = """
from rig.recording.journal import JournalWriter
from tests.rig.recording.samples import header, rows
with JournalWriter.create(sys.argv[1], header()) as writer:
    writer.part({"first_sample": 0})
    limit(100_000)
    try:
        for first in range(0, 10**6, 150):
            writer.rows(rows(first, first + 150))
    except RecordingError as error:
        print(error)
    print(writer.n_rows)
    writer.end({"completed": False, "reason": "disk full"})
    lift()
    writer.part({"first_sample": writer.n_rows})
    writer.rows(rows(writer.n_rows, writer.n_rows + 1000))
"""
    path = tmp_path / "a.journal"
    message, n_rows = run(code, path)
    n = int(n_rows)
    assert message == f"{path}: cannot be written (File too large); the {n} rows and 0 points before are kept"
    assert 100_000 - 2 * 150 * ROW.itemsize < n * ROW.itemsize < 100_000
    with JournalContents(path) as contents:
        assert contents.tail.n_bytes == 0
        assert [part.n_rows for part in contents.parts] == [n, 1000]
        assert contents.parts[0].end == {"completed": False, "reason": "disk full"}
        together = np.concatenate([all_rows(part) for part in contents.parts])
    assert together.tobytes() == rows(0, n + 1000).tobytes()


@pytest.mark.slow
@posix
def test_a_conversion_on_a_full_disk_leaves_journal_and_old_file_at_any_moment(tmp_path):
    output = tmp_path / "OUT.h5"
    with JournalWriter.create(journal_path(output), header()) as writer:
        fill(writer, 0, 1000, completed=False)
    finalise(journal_path(output), output)
    old = output.read_bytes()
    code = """
from rig.recording.journal import journal_path
from rig.recording.conversion import continue_recording, finalise
from tests.rig.recording.samples import fill
from pathlib import Path
output = Path(sys.argv[1])
with continue_recording(output) as writer:
    fill(writer, 1000, 20_000)
old, journal, failures = output.read_bytes(), journal_path(output).read_bytes(), 0
for size in (0, 500, 3000, *range(10_000, 10**7, 25_000)):
    limit(size)
    try:
        finalise(journal_path(output), output)
    except RecordingError as error:
        failures += 1
        lift()
        assert output.read_bytes() == old and journal_path(output).read_bytes() == journal
        message = str(error)
    else:
        break
print(failures)
print(message)
"""
    failures, message = run(code, output)
    assert int(failures) > 10
    assert message == f"{output}: cannot be written (File too large); the journal {journal_path(output)} is kept"
    assert output.read_bytes() != old
    assert [path.name for path in tmp_path.iterdir()] == ["OUT.h5"]
    with h5py.File(output) as file:
        assert file["parts/1/rows/sample"][-1] == 20_999


@posix
def test_no_room_for_the_header_leaves_no_journal(tmp_path):
    code = """
from rig.recording.journal import JournalWriter
from tests.rig.recording.samples import header
limit(100)
try:
    JournalWriter.create(sys.argv[1], header())
except RecordingError as error:
    print(error)
"""
    (message,) = run(code, tmp_path / "a.journal")
    assert "cannot be written (File too large)" in message
    assert not list(tmp_path.iterdir())


def test_after_an_interrupt_within_a_block_the_journal_still_ends_with_a_whole_one(tmp_path, monkeypatch):
    path = tmp_path / "a.journal"
    real_write = os.write

    def interrupted(descriptor, data):
        real_write(descriptor, bytes(data)[: len(data) // 2])
        raise KeyboardInterrupt

    with JournalWriter.create(path, header()) as writer:
        fill(writer, 0, 200, completed=None)
        monkeypatch.setattr(os, "write", interrupted)
        with pytest.raises(KeyboardInterrupt):
            writer.rows(rows(200, 300))
        monkeypatch.undo()
        writer.end({"completed": False})
    with JournalContents(path) as contents:
        assert contents.tail.n_bytes == 0
        assert contents.parts[0].n_rows == 200
        assert contents.parts[0].end == {"completed": False}


def test_a_half_block_that_cannot_be_taken_back_ends_the_writing_and_is_cut_off_on_resuming(tmp_path, monkeypatch):
    path = tmp_path / "a.journal"
    real_write = os.write

    def failing(descriptor, data):
        if len(data) > 1000:
            return real_write(descriptor, data[:1000])
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    def no_truncation(descriptor, size):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with JournalWriter.create(path, header()) as writer:
        fill(writer, 0, 200, completed=None)
        monkeypatch.setattr(os, "write", failing)
        monkeypatch.setattr(os, "ftruncate", no_truncation)
        with refused(RecordingError, "cannot-be-written-rows-and-points"):
            writer.rows(rows(200, 300))
        monkeypatch.undo()
        with refused(RecordingError, "no-further-writes-after-an-earlier"):
            writer.end({})
    with JournalWriter.reopen(path) as writer:
        assert writer.dropped.n_bytes > 0
        assert writer.n_rows == 200


def test_a_disk_that_cannot_be_synchronised_is_told(tmp_path, monkeypatch):
    def failing(descriptor):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    writer = JournalWriter.create(tmp_path / "a.journal", header())
    fill(writer, 0, 10, completed=None)
    monkeypatch.setattr("rig.recording.appending._fdatasync", failing)
    with refused(RecordingError, "cannot-be-forced-to-the-disk"):
        writer.close()
    monkeypatch.undo()
    with JournalContents(tmp_path / "a.journal") as contents:
        assert contents.parts[0].n_rows == 10


def test_an_interrupt_during_the_conversion_leaves_only_the_journal(tmp_path, monkeypatch):
    output = tmp_path / "OUT.h5"
    journal(journal_path(output), 100)

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.recording.hdf5_recording._write_part", interrupted)
    with pytest.raises(KeyboardInterrupt):
        finalise(journal_path(output), output)
    assert [path.name for path in tmp_path.iterdir()] == ["OUT.h5.journal"]
