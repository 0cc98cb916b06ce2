"""A run that publishes in one process is read in another: all of it, nothing torn, and known as dead once it is."""

import errno
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rig.errors import RecordingError
from rig.live.layout import BINS
from rig.live.place import base_folder, lives, new_folder, runs
from rig.live.publisher import Live, Publisher, published
from rig.live.reader import LiveRun, run_into
from rig.tick.safety.layout import GuardMode
from tests.refused import refused
from tests.rig.live.writer import BENCH, FACTS, ROWS, chunk, made_loop
from tests.waiting import LONG_S

WRITER = "tests.rig.live.writer"
N = len(BENCH.channels)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks of files of dead processes")


def folder_of(child):
    return Path(child.stdout.readline().strip())


def done(child):
    assert child.stdout.readline() == "done\n"


def test_a_late_reader_gets_every_line_and_every_bin(started):
    child = started(WRITER, "lines", 200)
    folder = folder_of(child)
    done(child)
    run = LiveRun(folder)
    lines = run.lines(0)
    assert [line["is"] for line in lines] == ["part", *["point"] * 200]
    assert [line["number"] for line in lines[1:]] == list(range(200))
    assert lines[-1]["text"] == "é" * 199
    assert run.lines(150) == lines[150:]
    first, bins = run.bins(0)
    assert first == 0
    np.testing.assert_allclose(bins["end_s"] * BENCH.sample_rate_hz, ROWS * np.arange(1, 201))
    np.testing.assert_array_equal(bins["inputs"][:, N - 1, 1], ROWS * np.arange(1, 201))
    assert run.bins(198)[0] == 198
    assert run.bins(198)[1].size == 2
    run.close()


@pytest.mark.slow
def test_lines_are_read_while_they_are_written(started):
    child = started(WRITER, "lines", 3000)
    run = LiveRun(folder_of(child))
    seen, deadline = [], time.monotonic() + 60.0
    while len(seen) < 3001 and time.monotonic() < deadline:
        seen += run.lines(len(seen))
    assert [line["number"] for line in seen[1:]] == list(range(3000))
    run.close()


def test_of_more_bins_than_are_kept_the_last_are_read(started):
    child = started(WRITER, "bins", BINS + 777)
    run = LiveRun(folder_of(child))
    done(child)
    first, bins = run.bins(0)
    assert (first, bins.size) == (778, BINS - 1)
    np.testing.assert_array_equal(bins["inputs"][:, 0, 0], ROWS * np.arange(779, BINS + 778))
    assert run.bins(BINS + 777)[1].size == 0
    run.close()


def test_no_frame_that_is_read_was_written_in_two_halves(started):
    child = started(WRITER, "hammer", 0)
    run = LiveRun(folder_of(child))
    seen, began = [], time.monotonic()
    while (passed_s := time.monotonic() - began) < 1.0 or (len(set(seen)) <= 50 and passed_s < LONG_S):
        frame = run.frame()
        if frame is None:
            continue
        state, window, _ = frame
        last = int(state["sample"])
        assert (state["level"], state["value"]) == (last, last)
        assert window["frequency_hz"][-1] == last
        assert window["inputs"][-1, N - 1] == last
        assert np.isin(np.diff(window["frequency_hz"]), (0, ROWS)).all()  # no rows of an older frame between
        seen.append(last)
    run.close()
    assert seen == sorted(seen)
    assert len(set(seen)) > 50


def test_a_killed_run_is_known_as_dead_and_its_folder_goes_with_the_next_run(started):
    child = started(WRITER, "lines", 5)
    folder = folder_of(child)
    done(child)
    run = LiveRun(folder)
    assert run.connected
    assert runs() == [folder]
    child.kill()
    child.wait()
    assert not run.connected
    assert runs() == []
    assert run_into() is None
    assert len(run.lines(0)) == 6  # what was told last can still be read
    assert run.frame() is not None
    assert folder.exists()
    made, descriptor = new_folder(b"{}")
    assert [path.name for path in made.parent.iterdir()] == [made.name]
    os.close(descriptor)
    run.close()


def test_a_folder_that_is_being_made_is_left_alone(place):
    """Another run may be about to lock it: to look whether it is locked could be in its way."""
    young, old = place / f".1-{16 * 'a'}", place / f".2-{16 * 'b'}"
    for folder in (young, old):
        folder.mkdir(parents=True)
        place.chmod(0o700)
        (folder / "lock").touch()
    os.utime(old, (1e9, 1e9))
    made, descriptor = new_folder(b"{}")
    assert sorted(path.name for path in place.iterdir()) == sorted([young.name, made.name])
    os.close(descriptor)


def test_two_runs_at_once_are_told_apart_and_end_apart(started):
    one, other = started(WRITER, "lines", 3), started(WRITER, "lines", 4)
    folders = [folder_of(one), folder_of(other)]
    done(one)
    done(other)
    assert sorted(runs()) == sorted(folders)
    with LiveRun(folders[0]) as run, LiveRun(folders[1]) as another:
        assert (len(run.lines(0)), len(another.lines(0))) == (4, 5)
    one.stdin.write("\n")
    one.stdin.flush()
    one.wait()
    assert runs() == [folders[1]]
    assert not folders[0].exists()
    with run_into(Path("/nowhere/made.h5")) as run:
        assert run.folder == folders[1]
    assert run_into(Path("/nowhere/other.h5")) is None


def test_an_ended_run_can_be_read_to_its_last_line_by_whoever_had_it_open():
    with Publisher(FACTS, N) as live:
        run = LiveRun(live.folder)
        live.line("end", {"text": "over"})
    assert not run.connected
    assert run.lines(0) == [{"text": "over", "is": "end"}]
    with refused(RecordingError, "is-no-run-under-way"):
        LiveRun(live.folder)
    run.close()


def test_between_two_parts_there_is_no_frame_and_after_a_request_no_further_part():
    loop = made_loop()
    with Publisher(FACTS, N) as live:
        run = LiveRun(live.folder)
        assert run.frame() is None
        live.take(chunk(loop, 0), loop, 0, 1)
        assert run.frame() is not None
        assert live.another_part()
        assert run.frame() is None
        live.take(chunk(loop, 1), loop, 0, 1)
        run.request_stop("enough")
        assert not live.another_part()
        assert run.frame() is not None
        run.close()


def test_a_first_request_is_kept_and_one_that_was_left_before_is_heeded_at_once():
    with Publisher(FACTS, N) as live:
        run = LiveRun(live.folder)
        run.request_stop("first \x1b[31m")
        run.request_stop("second")
        heard = []
        with live.stopping_on_request(heard.append):
            assert heard == ["first \\x1b[31m"]
        assert len(heard) == 1
        run.close()


def test_a_request_needs_no_text_for_the_memory_may_be_full(monkeypatch):
    with Publisher(FACTS, N) as live, LiveRun(live.folder) as run:
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", full)
            run.request_stop("no room for this")
        heard = []
        with live.stopping_on_request(heard.append):
            pass
        assert heard == ["stopped by request"]
        assert sorted(path.name for path in live.folder.glob("*stop*")) == ["stop"]


def test_a_request_that_cannot_be_left_is_an_error():
    with Publisher(FACTS, N) as live:
        run = LiveRun(live.folder)
    with refused(RecordingError, "use-the-hardware-stop"):
        run.request_stop("too late")
    run.close()


def full(*arguments):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_where_the_memory_is_full_a_run_is_not_published_and_says_so(monkeypatch, place):
    monkeypatch.setattr(os, "posix_fallocate", full)
    remarks = []
    with published(FACTS, N, remarks.append) as live:
        assert type(live) is Live
    (remark,) = remarks
    assert "from another terminal" in remark
    assert "No space left" in remark
    assert list(place.iterdir()) == []


def test_lines_that_find_the_memory_full_are_left_out_and_harm_no_other(monkeypatch):
    write = os.write
    with Publisher(FACTS, N) as live:
        run = LiveRun(live.folder)
        live.line("event", {"n": 0})
        monkeypatch.setattr(os, "write", full)
        live.line("event", {"n": 1})
        monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:5]))
        live.line("event", {"n": 2})
        monkeypatch.setattr(os, "write", write)
        live.line("event", {"n": 3})
        assert [line["n"] for line in run.lines(0)] == [0, 3]
        run.close()


def test_an_error_in_publishing_is_told_once_and_raised_never():
    remarks = []
    with published(FACTS, N, remarks.append) as live:
        for _ in range(3):
            live.take(np.zeros(3), None, 0, 1)
        live.line("event", {})
        heard = []
        with live.stopping_on_request(heard.append):
            pass
    (remark,) = remarks
    assert remark.startswith("the run can no longer be watched (")


def test_a_folder_of_somebody_else_is_refused(monkeypatch, place):
    base_folder()
    monkeypatch.setattr(os, "getuid", lambda: place.stat().st_uid + 1)
    with refused(RecordingError, "belongs-to-somebody-else-set"):
        base_folder()
    assert runs() == []
    remarks = []
    with published(FACTS, N, remarks.append) as live:
        assert type(live) is Live
    assert "belongs to somebody else" in remarks[0]


def test_a_link_in_place_of_the_folder_is_refused(place, tmp_path):
    place.parent.mkdir()
    (tmp_path / "elsewhere").mkdir()
    place.symlink_to(tmp_path / "elsewhere")
    with refused(RecordingError, "belongs-to-somebody-else"):
        base_folder()


def test_a_run_of_another_version_is_refused(monkeypatch):
    with Publisher(FACTS, N) as live:
        monkeypatch.setattr("rig.live.reader.BINS", BINS + 1)
        with refused(RecordingError, "another-version"):
            LiveRun(live.folder)
        assert lives(live.folder)


def test_where_the_driver_has_failed_the_output_is_what_was_put_out_last():
    """The worker writes OFF and 0 V into its state before the campaign hears of the failure; nobody knows of the output."""
    loop = made_loop()
    with Publisher(FACTS, N) as live, LiveRun(live.folder) as run:
        rows = chunk(loop, 0)
        rows["command_v"] = 0.17
        loop.tick.arrays.guard["mode"], loop.tick.arrays.guard["amplitude_v"] = GuardMode.OFF, 0.0
        live.take(rows, loop, 0, 1)
        frame = run.frame()
        assert frame is not None
        assert frame.state["guard"] == GuardMode.ARMED
        assert frame.state["voltage_v"] == pytest.approx(0.17)
